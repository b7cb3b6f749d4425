// The pieces of a model: their functions and weights along the curve, and what other joints would make of them.
(() => {
    "use strict";
    const { element, words, withUnit, axisLabel, wider, knob, choice, button, chart, zonesOf, weightsAt, joinedCurve } = window.mapmore;
    const POINTS = 301, PALETTE = ["--piece1", "--piece2", "--piece3", "--piece4"];
    const SIDES = { continue: "continue", continue_linear: "continue straight", saturate: "saturate", zero: "zero" };

    function explorePieces(box, { study, at, along, spans, heldRows, sampleAt, measured, inOrder, model }) {
        const pieces = study.pieces, code = mapmore.models[pieces.key], { variables, joint } = pieces;
        const names = study.inputs.map((one) => one.name).filter((name) => name !== pieces.level);
        const starts = pieces.curves.map((curve, k) => pieces.curves.slice(0, k).reduce((sum, one) => sum + one.segments.length, 0));
        const fitted = (name) => {
            const [below, above] = joint.extrapolation[name] ?? ["continue", "continue"];
            return below === above && below in SIDES ? below : "fitted";
        };

        const zs = knob("z_s", "", [0, 0.5], joint.z_s, () => changed());
        const transition = choice("transition", ["linear", "quadratic", "cubic"].map((one) => [one, one]), joint.transition, () => changed());
        const sides = Object.fromEntries(variables.map((name) => [name, choice(
            `extrapolation of ${words(name)}`,
            [...(fitted(name) === "fitted" ? [["fitted", "as fitted"]] : []), ...Object.entries(SIDES)], fitted(name), () => changed())]));
        const score = element("output", { className: "reading small" });
        const yaml = element("code", { className: "yaml" });
        const copy = button("Copy", async () => {
            await navigator.clipboard.writeText(yaml.textContent);
            copy.textContent = "Copied";
        });
        const list = element("div", { className: "segments" }), equation = element("p", { className: "equation" });
        const inner = element("details", { className: "pieces", open: true }, element("summary", {}, "Pieces, and other ways to join them"),
            element("p", { className: "note" }, "The pieces stay as they were fitted; only the way they are joined changes here. Run the study with the line below to make it the model."),
            element("div", { className: "choices" }, transition.row, ...variables.map((name) => sides[name].row)),
            element("div", { className: "knobs" }, zs.row), score, element("p", { className: "line-of-yaml" }, yaml, " ", copy));
        const row = element("div", { className: "two" });
        inner.append(list, row, equation);
        box.append(inner);
        const functions = chart(row, "The pieces, and the curve that they are joined to", 300), weights = chart(row, "The weights of the pieces", 300);

        const chosen = () => ({
            z_s: zs.value, transition: transition.value, hold: joint.hold,
            extrapolation: Object.fromEntries(names.map((name) => {
                const side = sides[name]?.value ?? "fitted";
                return [name, side === "fitted" ? joint.extrapolation[name] ?? ["continue", "continue"] : [side, side]];
            })),
        });

        /** The model, joined in another way: the code of the model has the levels and the backbone. */
        function joined(how) {
            code.rejoin(pieces.curves.map((curve, k) => {
                const own = [starts[k], starts[k] + curve.segments.length];
                return joinedCurve(curve, code.segments.slice(...own), code.slopes.slice(...own), variables, names, how);
            }));
            return (x) => code.evaluate(...inOrder(x));
        }

        /** The section of a spec that joins pieces in this way. */
        function yamlOf(how) {
            const word = ([below, above]) => (below === above ? below : `{below: ${below}, above: ${above}}`);
            const beyond = Object.entries({ ...joint.extrapolation, ...how.extrapolation })
                .map(([name, ends]) => `${name}: ${word(ends)}`).join(", ");
            const z_s = Number(how.z_s.toPrecision(4));
            return `fuse: {transition: ${how.transition}, z_s: ${z_s}, levels: ${joint.levels}, hold: ${how.hold}, extrapolation: {${beyond}}}`;
        }

        function errorOf(value) {
            let sum = 0, count = 0;
            for (const k of heldRows) {
                const error = value(sampleAt(k)) - measured[k];
                if (Number.isFinite(error)) [sum, count] = [sum + error ** 2, count + 1];
            }
            return { rmse: Math.sqrt(sum / count), count };
        }

        const before = errorOf((x) => model.evaluate(...inOrder(x)));

        function nearestCurve(x) {
            if (pieces.level === null) return 0;
            const away = pieces.curves.map((curve) => Math.abs(curve.level - x[pieces.level]));
            return away.indexOf(Math.min(...away));
        }

        function showEquation(segment) {
            equation.replaceChildren(element("strong", {}, `${segment.id}: `), segment.equation || "its equation stands below");
        }

        function changed() {
            const how = chosen(), value = joined(how), x = at(), axis = along();
            const { rmse, count } = errorOf(value);
            score.replaceChildren(count ? element("strong", {}, `RMSE ${withUnit(rmse, study.output)}`) : "no held-out samples",
                count ? element("span", { className: "slope" }, `on ${count} ${count < study.samples.all_held ? `of ${study.samples.all_held} ` : ""}held-out samples; as fitted ${withUnit(before.rmse, study.output)}`) : "");
            score.dataset.rmse = String(rmse);
            yaml.textContent = yamlOf(how);
            copy.textContent = "Copy";

            const number = nearestCurve(x), curve = pieces.curves[number], ends = wider(spans[axis], 0.15);
            const xs = Array.from({ length: POINTS }, (_, k) => ends[0] + ((ends[1] - ends[0]) * k) / (POINTS - 1));
            const place = variables.indexOf(axis);
            const level = pieces.level === null ? {} : { [pieces.level]: curve.level };
            const here = (one) => ({ ...x, ...level, [axis]: one });
            const unfit = study.inputs.find((one) => one.name === axis), layers = [], shares = [];
            const cells = variables.map((name, j) => weightsAt(x[name], zonesOf(curve.boundaries[j], how.z_s), how.transition)[0][0]);
            const shown = place < 0 ? [] : curve.segments.filter((one) => one.cell.every((cell, j) => j === place || cell === cells[j]));
            for (const [k, segment] of shown.entries()) {
                const zones = zonesOf(curve.boundaries[place], how.z_s), color = PALETTE[k % PALETTE.length], cell = segment.cell[place];
                const from = cell > 1 ? zones[cell - 2][0] : ends[0], to = cell <= zones.length ? zones[cell - 1][1] : ends[1];
                const f = code.segments[starts[number] + curve.segments.indexOf(segment)];
                const own = xs.filter((one) => one >= from && one <= to);
                const arguments_ = (one) => [...names.map((name) => here(one)[name]), ...(pieces.level === null ? [] : [curve.level])];
                layers.push({ kind: "line", x: own, y: own.map((one) => f(...arguments_(one))), color, width: 4, free: true });
                const share = xs.map((one) => (weightsAt(one, zones, how.transition).find(([which]) => which === cell) ?? [0, 0])[1]);
                shares.push({ kind: "line", x: xs, y: share, color });
            }
            if (axis !== pieces.level) layers.push({ kind: "line", x: xs, y: xs.map((one) => value(here(one))), color: "--ink", width: 1.2 });
            row.hidden = place < 0;
            if (place < 0) equation.replaceChildren();
            if (place < 0) list.replaceChildren(element("p", { className: "note" }, `Choose ${variables.map(words).join(" or ")} above to see the pieces along it.`));
            else {
                functions.show(axisLabel(unfit), axisLabel(study.output), ends, layers);
                weights.show(axisLabel(unfit), "Weight (–)", ends, shares);
                const heading = pieces.level === null ? "Segments: " : `Segments at ${words(pieces.level)} ${withUnit(curve.level, study.inputs.find((one) => one.name === pieces.level))}: `;
                list.replaceChildren(heading, ...shown.map((segment, k) => {
                    const made = button(segment.id, () => showEquation(segment));
                    made.style.borderColor = `var(${PALETTE[k % PALETTE.length]})`;
                    return made;
                }));
            }
            functions.holder.onclick = (event) => {
                const one = functions.at(event.offsetX - functions.holder.querySelector(".u-over").offsetLeft);
                const [[cell]] = weightsAt(one, zonesOf(curve.boundaries[place], how.z_s), how.transition).toSorted((a, b) => b[1] - a[1]);
                const segment = shown.find((other) => other.cell[place] === cell);
                if (segment) showEquation(segment);
            };
        }

        changed();
        return changed;
    }

    mapmore.explorePieces = explorePieces;
})();
