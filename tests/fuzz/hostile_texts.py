"""Texts that a stranger may put where a text is free, and what TeX makes of a source."""

import re

ESCAPES = (
    *(
        '"""',
        "'''",
        "*/",
        "*\\\n/",
        "/*",
        "//",
        "\\\n",
        "??/\n",
        "\n",
        "\r",
        "\r\n",
        "\u2028",
        "\x85",
        "\x0b",
        "\x0c",
        "\x00",
        "\x1b[2J",
    ),
    *(
        "\\",
        "\\\\",
        '"',
        "'",
        "`",
        "$",
        "\\$",
        "$$",
        "%",
        "#",
        "^^5c",
        "^^M",
        "^^",
        "^",
        "{",
        "}",
        "<!--",
        "-->",
        "]]>",
        "<?",
    ),
    *(
        "<![CDATA[",
        "&",
        "&lt;",
        "</title>",
        "<script>",
        "\ud800",
        "\ufffe",
        "\U0010ffff",
        "\u202e",
        "\ufeff",
        "%>",
        "{{x}}",
        "{% x %}",
    ),
    *(
        "\\N{DIGIT ONE}",
        "=1+1",
        "+1",
        "-1+cmd|' /C calc'!A0",
        "@x",
        "\t=1",
        ";",
        ",",
        " ",
        "  ",
        "é",
        "µ",
        "°C",
        "−",
        "Ω",
        "\u0430",
        "a",
    ),
    *("kPa", "1/s", "N*m"),
)
COMMANDS = (
    'import os; os.mkdir("MARK")',
    '__import__("os").mkdir("MARK")',
    '#include <sys/stat.h>\n__attribute__((constructor)) static void f(void) { mkdir("MARK", '
    "0777); }",
    "#error taken",
    "\\input{/etc/passwd}",
    "\\immediate\\write18{mkdir MARK}",
    "$\\input{/etc/passwd}$",
    "\\$\\input{/etc/passwd}\\$ $F$",
    '<script>document.title = "MARK"</script>',
    '" onload="MARK()" x="',
)


def text_of(chance, mark="MARK"):
    """A text: words that end something in some language, and commands behind them."""
    parts = [
        chance.choice(ESCAPES if chance.random() < 0.7 else COMMANDS)
        for _ in range(chance.randrange(1, 7))
    ]
    if chance.random() < 0.3:
        parts.append(
            "".join(
                chr(chance.randrange(0xD7FF) if chance.random() < 0.5 else chance.randrange(0x180))
                for _ in range(5)
            )
        )
    return "".join(parts).replace("MARK", mark)


def tex_commands(source):
    """The control sequences of a source as TeX reads it (The TeXbook, chapter 8): `^^` stands for
    characters, `%` ends a line.
    """
    for raw in re.split(r"\r\n|\r|\n", source):
        line, at = raw, 0
        while at < len(line):
            if found := re.compile(r"\^\^([0-9a-f]{2})|\^\^([\x00-\x7f])").match(line, at):
                code = int(found[1], 16) if found[1] else ord(found[2]) ^ 64
                line = line[:at] + chr(code) + line[found.end() :]
            if line[at] == "%":
                break
            if line[at] == "\\":
                name = re.compile(r"[A-Za-z@]+|.|$", re.DOTALL).match(line, at + 1)
                yield name[0]
                at = name.end() - 1
            at += 1
