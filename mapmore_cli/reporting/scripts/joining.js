// How pieces are joined within a curve (M2 eq 9-12), for other joints than that of the model.
// Levels and the backbone stay with the code of the model.
(() => {
  "use strict";
  const TRANSITIONS = {
    linear: (t) => t,
    quadratic: (t) => (t < 0.5 ? 2 * t ** 2 : 1 - 2 * (1 - t) ** 2),
    cubic: (t) => 3 * t ** 2 - 2 * t ** 3,
  };

  /** Start and end of the zone at each inner boundary (M2 eq 10 and 11). */
  function zonesOf(ends, z_s) {
    const zones = [];
    for (let i = 1; i < ends.length - 1; i += 1) {
      const [before, at, after] = ends.slice(i - 1, i + 2);
      zones.push([at - z_s * (at - before), at + z_s * (after - at)]);
    }
    return zones;
  }

  /** The pieces along one variable that count at x: `[place, weight]`, one or two. */
  function weightsAt(x, zones, transition) {
    for (let i = 0; i < zones.length; i += 1) {
      const [start, end] = zones[i];
      if (x <= start) return [[i + 1, 1]];
      if (x < end) {
        const rise = TRANSITIONS[transition]((x - start) / (end - start));
        return [[i + 1, 1 - rise], [i + 2, rise]];
      }
    }
    return [[zones.length + 1, 1]];
  }

  /** Between which values a segment function is held beyond its samples (`hold: samples`). */
  function heldBetween(segment, zones, ends, place, name, joint) {
    if (joint.hold === "none") return [-Infinity, Infinity];
    const [low, high] = segment.limits[name] ?? [-Infinity, Infinity];
    const reach = joint.z_s * (high - low), last = ends.length - 1;
    const below = place > 1 && low - reach > zones[place - 2][0];
    const above = place < last && high + reach < zones[place - 1][1];
    return [below ? low - reach : -Infinity, above ? high + reach : Infinity];
  }

  /**
   * A curve as a function of its free inputs in the order of `names`, and of the level where there
   * is one. `functions` and `slopes` are those of the segments, which are held nowhere.
   */
  function joinedCurve(curve, functions, slopes, variables, names, joint) {
    const zones = curve.boundaries.map((ends) => zonesOf(ends, joint.z_s));
    const cells = new Map(curve.segments.map((segment, k) => [String(segment.cell), k]));
    const held = curve.segments.map((segment) => variables.map((name, j) => (
      heldBetween(segment, zones[j], curve.boundaries[j], segment.cell[j], name, joint))));
    const columns = variables.map((name) => names.indexOf(name));

    function segmentAt(k, x, asked) {
      const inputs = x.slice();
      held[k].forEach(([low, high], j) => {
        inputs[columns[j]] = Math.min(Math.max(inputs[columns[j]], low), high);
      });
      let value = functions[k](...inputs);
      asked.forEach((way, j) => {
        if (way !== 0) value += slopes[k](...inputs)[1 + j] * way;
      });
      return value;
    }

    return (...given) => {
      const x = given.slice(), asked = names.map(() => 0);
      for (const [j, name] of names.entries()) {
        const [low, high] = curve.limits[name], [below, above] = joint.extrapolation[name];
        const ends = [[x[j] < low, below, low], [given[j] > high, above, high]];
        for (const [beyond, side, end] of ends) {
          if (!beyond) continue;
          if (side === "zero") return 0;
          if (side === "continue_linear") asked[j] = given[j] - end;
          if (side !== "continue") x[j] = typeof side === "number" ? side : end;
        }
      }
      let parts = [{ cell: [], w: 1 }];
      variables.forEach((name, j) => {
        const along = weightsAt(x[columns[j]], zones[j], joint.transition);
        parts = parts.flatMap(({ cell, w }) => (
          along.map(([place, weight]) => ({ cell: [...cell, place], w: w * weight }))));
      });
      const value = ({ cell, w }) => w * segmentAt(cells.get(String(cell)), x, asked);
      return parts.filter(({ w }) => w !== 0).reduce((sum, one) => sum + value(one), 0);
    };
  }

  Object.assign(window.mapmore, { TRANSITIONS, zonesOf, weightsAt, joinedCurve });
})();
