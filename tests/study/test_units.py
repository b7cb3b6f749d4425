"""Default units, conversion, quantities in text."""

import numpy as np
import pytest
from common import parts, python, rows_of
from hypothesis import given
from hypothesis import strategies as st

from mapmore_cli.domain.errors import SpecError
from mapmore_cli.modelling.expressions.states import IDENTIFIER
from mapmore_cli.study import units
from mapmore_cli.study.units import (
    can_convert,
    convert,
    default_unit,
    is_kept,
    is_same,
    parse_quantity,
)

ALONE = {
    "time": "s", "pressure": "kPa", "strain": "1", "force": "N", "length": "m", "displacement": "m",
        "load": "N", "input": "V",
    "pressure_rate": "kPa/s", "strain_rate": "1/s", "length_rate": "m/s", "step_pressure": "kPa",
        "colour": "1",
}  # fmt: skip
CHANGES = {"pressure": "bar", "time": "ms", "force_rate": "N/s"}
RATES = {"v": "displacement", "a": "v"}


@pytest.mark.parametrize(
    ("name", "changes", "rates", "unit"),
    [
        *((name, {}, {}, unit) for name, unit in ALONE.items()),
        ("pressure", CHANGES, {}, "bar"), ("pressure_rate", CHANGES, {}, "bar/ms"), ("force_rate",
            CHANGES, {}, "N/s"),
        ("v", {}, RATES, "m/s"), ("a", {}, RATES, "m/s/s"), ("a", {"v": "mm/s"}, RATES, "mm/s/s"),
        ("b", {}, {"b": "c", "c": "b"}, "1/s/s"),  # a circle, which is reported elsewhere
    ],
)  # fmt: skip
def test_default_units(name, changes, rates, unit):
    """The units of the spec come first, and rates follow them."""
    assert default_unit(name, changes, rates) == unit


def test_every_canonical_quantity_has_a_name_and_a_unit_that_are_known():
    for name, unit in units.CANONICAL.items():
        assert IDENTIFIER.fullmatch(name)
        units.check_unit(unit)


def test_rates_of_canonical_quantities_are_canonical():
    assert all(map(units.is_canonical, ("pressure", "strain_rate", "force_rate_rate")))
    assert not any(map(units.is_canonical, ("speed", "speed_rate", "_rate", "step_pressure")))


def test_every_unit_that_is_suggested_or_spelt_otherwise_is_known():
    for unit in units._KNOWN:
        units._pint_unit(unit)
    assert {*units._SPELLINGS.values()} <= units._KNOWN
    assert not {*units._SPELLINGS} & units._KNOWN


# Factors from the definitions of the units (BIPM; the pound and the inch are exact since 1959).
PSI = 0.45359237 * 9.80665 / 0.0254**2


@pytest.mark.parametrize(
    ("source", "target", "factor"),
    [*rows_of("""
bar      kPa    100
psi      kPa    6.894757293168361
MPa      kPa    1000
Pa       kPa    0.001
mbar     kPa    0.1
mm       m      0.001
cm       m      0.01
um       m      1e-06
µm       m      1e-06
in       m      0.0254
ms       s      0.001
min      s      60
h        s      3600
us       s      1e-06
kN       N      1000
lbf      N      4.4482216152605
kgf      N      9.80665
kp       N      9.80665
daN      N      10
‰        %      0.1
mdeg     deg    0.001
cmH2O    Pa     98.0665
inches   mm     25.4
mV       V      0.001
%        1      0.01
1        %      100
%/s      1/s    0.01
mm/m     1      0.001
kPa/ms   kPa/s  1000
(kPa)/s  Pa/ms  1
N m      N*m    1
N·m      N*m    1
Nm       N*m    1
mNm      Nm     0.001
Nmm      Nm     0.001
N cm     Nm     0.01
kNm      Nm     1000.0
(1)/s    %/s    100
N/mm^2   kPa    1000
N/mm**2  kPa    1000
""", float),
(' bar ', 'kPa', 100)],
)  # fmt: skip
def test_conversions_of_numbers_and_arrays(source, target, factor):
    assert convert(3.0, source, target) == pytest.approx(3 * factor, rel=1e-12)
    assert convert(3.0 * factor, target, source) == pytest.approx(3, rel=1e-12)
    values = np.array([-1.0, 0.0, 2.5])
    np.testing.assert_allclose(convert(values, source, target), values * factor, rtol=1e-12)
    assert values.tolist() == [-1.0, 0.0, 2.5]


def test_units_with_an_offset():
    """An absolute pressure is an atmosphere more than that of a gauge."""
    assert convert(20.0, "°C", "K") == pytest.approx(293.15)
    for unit in ("psia", "psi(a)", "PSI abs"):
        assert convert(14.6959487755, unit, "kPa") == pytest.approx(0, abs=1e-6)
    assert convert(
        convert(np.array([-20.0, 700.0]), "kPa", "bar(a)"), "bara", "kPa"
    ) == pytest.approx([-20, 700])
    assert convert(1.0, "psia/s", "kPa/s") == pytest.approx(PSI / 1000)


@pytest.mark.parametrize(
    ("text", "like", "unit"),
    [*rows_of("""
psig            -    psi
(PSI)           -    psi
P [psi(g)]      -    psi
psi gauge       -    psi
bar(a)          -    bara
P (bara)        -    bara
Bar abs         -    bara
[bar absolute]  -    bara
°C              -    degC
degC            -    degC
deg C           -    degC
T [°C]          -    degC
Nm              -    N*m
N·m             -    N*m
torque (N m)    -    N*m
µm              -    um
strain [-]      -    1
Pct             -    %
w (µm/s)        -    um/s
inHg            -    inHg
mmH2O           kPa  mmH2O
kPag            kPa  kPa
lbs             -    lbf
kg              -    kg
kg              N    kgf
x (‰)           -    permille
n [U/min]       -    rpm
Force [daN]     N    daN
g               kPa  none
mm              kPa  none
P_kPa_A         -    none
kgf/cm2         kPa  kgf/cm^2
lb              N    lbf
a (m/s²)        -    m/s^2
kPa(a)          -    kPa_abs
kPaa            -    none
N/A             -    none
KN              -    kN
S               -    none
S               s    s
xy2             -    none
force           -    none
"""), ("", "-", "none")],
)  # fmt: skip
def test_the_unit_that_a_text_names(text, like, unit):
    found = units.unit_of(text, None if like == "-" else like)
    assert found == (None if unit == "none" else unit)


def test_everyday_units_need_no_pint():
    code = (
        "import sys; from mapmore_cli.study.units import convert; convert(1.0, 'kPa', 'kPa'); "
        "convert(88.0, 'mm', 'm'); "
        "assert 'pint' not in sys.modules"
    )
    python(code, check=True)


@pytest.mark.parametrize(
    ("source", "target", "words"),
    [*rows_of("""
kpa                                                         kPa  \
    'kpa' is unknown | did you mean `kPa`?
PSI                                                         kPa  did you mean `psi`?
pa                                                          kPa  \
    'pa' | 'kPa' (a pressure) | did you mean `Pa`?
kPA                                                         kPa  did you mean `kPa`?
mm                                                          kPa  \
    'mm' (a length) | 'kPa' (a pressure) | same dimension as 'kPa'
g                                                           N  \
    'g' (a mass) | 'N' (a force) | did you mean `gf`
N                                                           1  \
    'N' (a force) | '1' (a plain number)
furlongs of joy                                             m    is unknown | write units as
kPa                                                         bra  \
    'bra' is unknown | did you mean `bar`?
__import__('os')                                            m    is unknown
m**9**9**9**9                                               m    is unknown
((((((((((((((((((((((((((((((m)))))))))))))))))))))))))))))  m    is unknown
3 m                                                         m    is unknown
""", parts),
("", "m", ["'' is unknown"]),
("m" * 10_000, "m", ["is unknown"])],
)  # fmt: skip
def test_wrong_units_are_named_with_a_remedy(source, target, words):
    with pytest.raises(SpecError) as caught:
        convert(1.0, source, target)
    assert all(word in str(caught.value) for word in words), str(caught.value)
    assert caught.value.remedy
    assert len(str(caught.value)) < 300


@pytest.mark.parametrize(
    ("text", "unit", "value"),
    [*rows_of("""
250 kPa   kPa   250
1.1 bar   kPa   110
88 mm     m     0.088
-40.2 s   s     -40.2
50%       1     0.5
3         N     3
.5e1 m    mm    5000
+2 kPa/s  Pa/s  2000
1e-3bar   Pa    100
20 degC   K     293.15
17.45 cm  m     0.1745
""", float),
(" 7  ms ", "s", 0.007)],
)  # fmt: skip
def test_parse_quantity_gives_the_exact_decimal(text, unit, value):
    assert parse_quantity(text, unit) == value


@given(st.text(st.sampled_from("kPabrsm1%/*^()-°Cµ 29_."), max_size=12))
def test_any_text_is_a_unit_or_refused(text):
    try:
        convert(1.0, text, "kPa")
    except SpecError as error:
        assert error.remedy  # noqa: PT017 (most texts are refused, a few are units of pressure)


def test_the_table_of_everyday_units_is_pints():
    rates = [f"{unit}/{time}" for unit in units._EVERYDAY for time in ("s", "ms", "min")]
    known = [*units._EVERYDAY, *rates]
    factors = [
        (a, b, factor)
        for a in known
        for b in known
        if (factor := units._everyday_factor(a, b)) is not None
    ]
    assert len(factors) > 500
    for source, target, factor in factors:
        expected = (
            units._registry()
            .Quantity(1.0, units._pint_unit(source))
            .to(units._pint_unit(target))
            .magnitude
        )
        assert factor == pytest.approx(expected, rel=1e-15)


def test_what_nobody_knows_is_no_unit_of_anything():
    assert is_kept("mm")
    assert not is_kept("%")
    for unit in ("flurbs", ""):
        assert not is_kept(unit)
        assert not can_convert(unit or "flurbs", "kPa")
        assert not is_same(unit or "flurbs", "kPa")
    assert can_convert("psi", "kPa")
    assert not is_same("psi", "kPa")
    assert is_same("kPa", "kilopascal")


def powers(**exponents):
    """Powers of base units in the order of the alphabet, in which they are written into files."""
    return list(exponents.items())


@pytest.mark.parametrize(
    ("unit", "factor", "offset", "base"),
    [
        ("kPa", 1e3, 0.0, powers(kg=1, m=-1, s=-2)),
        ("N*s/mm", 1e3, 0.0, powers(kg=1, s=-1)),
        ("cm^3/min", 1e-6 / 60, 0.0, powers(m=3, s=-1)),
        ("mA", 1e-3, 0.0, powers(A=1)),
        ("degC", 1.0, 273.15, powers(K=1)),
        ("degF", 5 / 9, 459.67 * 5 / 9, powers(K=1)),
        ("%", 0.01, 0.0, []),
    ],
)
def test_base_units_are_those_of_the_si(unit, factor, offset, base):
    found = units.base_units(unit)
    assert (found.factor, found.offset) == pytest.approx((factor, offset), rel=1e-14)
    assert list(found.powers.items()) == base


def test_base_units_are_in_the_order_of_the_alphabet():
    assert [*units.base_units("cd*K*s/m").powers] == ["K", "cd", "m", "s"]


def test_a_capital_m_of_a_short_unit_is_not_read_as_milli():
    assert units.unit_of_file("MOhm", "ohm") in (None, "MOhm")


def test_a_unit_has_at_most_sixty_characters():
    units.check_unit("m*" * 29 + "mm")
    with pytest.raises(SpecError):
        units.check_unit("m*" * 30 + "mm")


def test_an_unknown_unit_of_sixty_characters_is_shown_whole():
    with pytest.raises(SpecError, match=rf"'{'x' * 60}'"):
        units.check_unit("x" * 60)


def test_without_whole_powers_of_known_units_there_are_no_base_units():
    assert units.base_units("kPa^0.5") is units.base_units("flurbs") is None
