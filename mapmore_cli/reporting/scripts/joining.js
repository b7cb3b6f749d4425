// Join pieces within a curve (M2 eq 9-12) in other ways than the model does. The code of the model
// still treats levels and the backbone.

/** Return start and end of the transition zone at each inner boundary (M2 eq 10 and 11). */
export const zonesOf = (ends, z_s) => ends.slice(1, -1).map((at, i) => (
  [at - z_s * (at - ends[i]), at + z_s * (ends[i + 2] - at)]));

/**
 * Return the weights of the pieces along one variable at x; at most two are not zero. A weight has
 * the course `transition`, which is a function of the place from 0 to 1 in a zone.
 */
export function weightsAt(x, zones, transition) {
  const rises = zones.map(([start, end]) => {
    if (x <= start) return 0;
    return x < end ? transition((x - start) / (end - start)) : 1;
  });
  return [1, ...rises].map((rise, i) => rise - (rises[i] ?? 0));
}

/** Return the limits beyond which a segment function is constant (`hold: samples`). */
function heldBetween(segment, zones, ends, place, name, joint) {
  if (joint.hold === "none") return [-Infinity, Infinity];
  const [low, high] = segment.limits[name] ?? [-Infinity, Infinity];
  const reach = joint.z_s * (high - low), last = ends.length - 1;
  const below = place > 1 && low - reach > zones[place - 2][0];
  const above = place < last && high + reach < zones[place - 1][1];
  return [below ? low - reach : -Infinity, above ? high + reach : Infinity];
}

/**
 * Return a curve as a function of its free inputs, in the order of `names`, and of the level if
 * there is one. `functions` and `slopes` are those of the segments, without any limits;
 * `transition` is as in `weightsAt`.
 */
export function joinedCurve(curve, functions, slopes, variables, names, joint, transition) {
  const zones = curve.boundaries.map((ends) => zonesOf(ends, joint.z_s));
  const held = curve.segments.map((segment) => variables.map((name, j) => (
    heldBetween(segment, zones[j], curve.boundaries[j], segment.cell[j], name, joint))));
  const columns = variables.map((name) => names.indexOf(name));

  /** Return the value of a segment, continued by straight lines over the steps in `straight`. */
  function segmentAt(k, x, straight) {
    const inputs = x.slice();
    held[k].forEach(([low, high], j) => {
      inputs[columns[j]] = Math.min(Math.max(inputs[columns[j]], low), high);
    });
    const slope = straight.some(Boolean) ? slopes[k](...inputs) : [];
    return straight.reduce((sum, step, j) => (step ? sum + slope[1 + j] * step : sum),
      functions[k](...inputs));
  }

  return (...given) => {
    const x = given.slice(), straight = names.map(() => 0);
    for (const [j, name] of names.entries()) {
      const [low, high] = curve.limits[name], [below, above] = joint.extrapolation[name];
      if (!(given[j] < low || given[j] > high)) continue;
      const [side, end] = given[j] < low ? [below, low] : [above, high];
      if (side === "zero") return 0;
      if (side === "continue_linear") straight[j] = given[j] - end;
      if (side !== "continue") x[j] = typeof side === "number" ? side : end;
    }
    const weights = variables.map((_, j) => (
      weightsAt(x[columns[j]], zones[j], transition)));
    return curve.segments.reduce((sum, { cell }, k) => {
      const weight = cell.reduce((w, place, j) => w * weights[j][place - 1], 1);
      return weight === 0 ? sum : sum + weight * segmentAt(k, x, straight);
    }, 0);
  };
}
