// The page of a run: the sweep as a map and curves, accuracy and cost, the data.
TC.run = {
  setup(given) {
    const run = TC.data.run;
    const state = TC.state;
    run.points = run.shape.reduce((product, count) => product * count, 1);
    run.nlevels = run.levels.h_max.length;
    run.grid = run.mode === "grid";
    run.varied = run.grid ? run.axes.filter((axis) => axis.values.length > 1) : run.axes;
    const byName = (name) => run.varied.find((axis) => axis.name === name);
    const numeric = run.varied.filter((axis) => axis.numeric);
    const texts = run.varied.filter((axis) => !axis.numeric);
    const numericByCount = [...numeric].sort(
      (first, second) => new Set(second.values).size - new Set(first.values).size,
    );
    state.x = (byName(given.x) || numericByCount[0] || texts[0] || {}).name;
    const upAxes = [...numericByCount, ...texts].filter((axis) => axis.name !== state.x);
    state.y = (byName(given.y) && given.y !== state.x ? byName(given.y) : upAxes[0] || {}).name;
    const seriesAxes = [...texts, ...numericByCount].filter(
      (axis) => axis.name !== state.x && !axis.drawn,
    );
    state.by = (seriesAxes.find((axis) => axis.name === given.by) || seriesAxes[0] || {}).name;
    const names = Object.keys(run.numbers);
    state.q = names.includes(given.q) ? given.q : names[0];
    state.level = TC.indexBelow(given.level, run.nlevels, run.nlevels - 1);
    state.at = TC.run.indicesFrom(given.at) || TC.run.pointOfLargestSlip();
    state.vs = TC.run.indicesFrom(given.vs) || null;
    state.eq = TC.indexBelow(given.eq, 1e6, 0);
    state.deform =
      given.deform !== undefined && Number.isFinite(Number(given.deform))
        ? Number(given.deform)
        : 1;
    state.sort = given.sort !== undefined ? Number(given.sort) : -1;
    state.down = given.down === "1" ? 1 : 0;
    state.step = given.step;
    for (const key of ["xof", "yof"]) if (given[key]) state[key] = given[key];
    state.mode = given.mode === "live" && TC.data.live ? "live" : "";
  },
  indicesFrom(text) {
    if (text === undefined) return null;
    const at = String(text).split(",").map(Number);
    const shape = TC.data.run.shape;
    if (!shape.length) return [];
    return at.length === shape.length &&
      at.every(
        (index, dimension) => Number.isInteger(index) && index >= 0 && index < shape[dimension],
      )
      ? at
      : null;
  },
  // The solved point with the largest slip: what one looks for first.
  pointOfLargestSlip() {
    const run = TC.data.run;
    const largestSlip = run.numbers.u_T_max;
    const level = run.nlevels - 1;
    let worstPoint = 0;
    let largest = -1;
    for (let point = 0; point < run.points; point++)
      if (
        TC.run.flag("status", point, level) === 1 &&
        largestSlip &&
        largestSlip.v[point * run.nlevels + level] > largest
      ) {
        largest = largestSlip.v[point * run.nlevels + level];
        worstPoint = point;
      }
    return TC.run.indicesOf(worstPoint);
  },
  indicesOf(point, shape = TC.data.run.shape) {
    const indices = [];
    for (let dimension = shape.length - 1; dimension >= 0; dimension--) {
      indices[dimension] = point % shape[dimension];
      point = Math.floor(point / shape[dimension]);
    }
    return indices;
  },
  pointAt: (at) =>
    at.reduce((point, index, dimension) => point * TC.data.run.shape[dimension] + index, 0),
  axis: (name) => TC.data.run.axes.find((axis) => axis.name === name),
  dimensionOf: (name) => TC.data.run.dims.indexOf(TC.run.axis(name).dim),
  flag(name, point, level) {
    const flag = TC.data.run.flags[name];
    return flag ? flag[point * TC.data.run.nlevels + level] : 0;
  },
  value(name, point, level) {
    const quantity = TC.data.run.numbers[name];
    return quantity ? quantity.v[point * TC.data.run.nlevels + level] : NaN;
  },
  energies(point, level) {
    const run = TC.data.run;
    const startCount = run.starts.length;
    return run.start_energy
      ? Array.from(
          run.start_energy.slice(
            (point * run.nlevels + level) * startCount,
            (point * run.nlevels + level + 1) * startCount,
          ),
        )
      : [];
  },
  // Sizes of the levels, of the geometry of point p where there are several.
  levels: (point) => TC.point.geometryOf(point).levels || TC.data.run.levels,
  // Whether the starts led to different energies.
  hasSeveral: (point, level) => TC.run.flag("several", point, level) === 1,
  words(at) {
    const run = TC.data.run;
    if (!run.axes.length) return "the one point of the study";
    return run.axes
      .map((axis) =>
        `${TC.symbol(axis.name)} = ${TC.axisText(axis, at[TC.run.dimensionOf(axis.name)])}`.replace(
          axis.numeric ? /$^/ : " = ",
          ": ",
        ),
      )
      .join(", ");
  },
  // What is known of a point: failed, unique, global, local, nothing.
  proof(point, level) {
    if (TC.run.flag("status", point, level) !== 1) return "failed";
    for (const [flag, word] of [
      ["unique", "unique"],
      ["global_minimum", "global"],
      ["strict_minimum", "local"],
    ])
      if (TC.run.flag(flag, point, level) === 1) return word;
    return "nothing";
  },
  draw() {
    const host = TC.run.host || (TC.run.host = TC.run.layout());
    TC.run.controls(host.controls);
    TC.run.map(host.map);
    TC.run.curves(host.curves);
    if (TC.data.steps) {
      const point = TC.run.pointAt(TC.state.at);
      const history = TC.data.steps[point];
      TC.show(
        host.point,
        history.point,
        TC.data.run.points > 1 ? TC.el("p", {}, TC.el("b", {}, TC.run.words(TC.state.at))) : null,
      );
      TC.show(host.accuracy, history.accuracy);
      TC.show(host.steps, history.table);
    } else {
      TC.point.draw(host.point);
      TC.run.accuracy(host.accuracy);
    }
    if (host.rows) TC.run.rows(host.rows);
  },
  layout() {
    document.getElementById("main").replaceChildren();
    const sweep = TC.data.run.varied.length ? TC.section("1  The sweep", "sweep") : TC.el("div");
    const controls = TC.el("div", { class: "controls noprint" });
    const map = TC.panel();
    const curves = TC.panel();
    const hasMap = TC.data.run.varied.length > 1;
    sweep.append(controls, hasMap ? TC.el("div", { class: "columns" }, map, curves) : curves);
    const swept = TC.data.run.varied.length > 0;
    const steps = Boolean(TC.data.steps);
    const heading = (number) => `${swept ? number : number - 1}  `;
    const point = TC.section(
      steps ? heading(2) + "Loop and steps" : swept ? "2  The point" : "The solution",
      "point",
    );
    const accuracy = TC.section(
      steps ? heading(3) + "Energies and cycles" : "3  How accurate, at what cost",
      "accuracy",
    );
    const data = TC.section((steps ? heading(4) : "4  ") + "The data", "table");
    const rows = steps && !swept ? null : TC.el("div");
    const stepRows = steps ? TC.el("div", { id: "steps" }) : null;
    data.append(...[stepRows, rows].filter(Boolean));
    TC.provenance(data);
    return { controls, map: hasMap ? map : null, curves, point, accuracy, rows, steps: stepRows };
  },
  controls(host) {
    const run = TC.data.run;
    const state = TC.state;
    const controls = [];
    controls.push(
      TC.choice(
        "quantity",
        Object.keys(run.numbers).map((name) => [name, TC.symbol(name)]),
        state.q,
        (q) => TC.set({ q }),
      ),
    );
    if (run.varied.length > 1) {
      const axisOptions = run.varied.map((axis) => [axis.name, TC.symbol(axis.name)]);
      const seriesOptions = axisOptions.filter(
        ([name]) => name !== state.x && !TC.run.axis(name).drawn,
      );
      controls.push(
        TC.choice("across", axisOptions, state.x, (x) =>
          TC.set({
            x,
            y: x === state.y ? state.x : state.y,
            by: x !== state.by ? state.by : TC.run.axis(state.x).drawn ? undefined : state.x,
          }),
        ),
      );
      controls.push(
        TC.choice(
          "map: up",
          axisOptions.filter(([name]) => name !== state.x),
          state.y,
          (y) => TC.set({ y }),
        ),
      );
      if (seriesOptions.length)
        controls.push(
          TC.choice("curves: one for each", seriesOptions, state.by, (seriesOptions) =>
            TC.set({ by: seriesOptions }),
          ),
        );
    }
    if (run.nlevels > 1)
      controls.push(
        TC.slider(
          "level",
          TC.run
            .levels(TC.run.pointAt(state.at))
            .h_max.map((size, index) => `${index} (h = ${TC.quantity(size, run.units.h_max, 3)})`),
          state.level,
          (level) => TC.set({ level }),
        ),
      );
    if (run.grid)
      for (const axis of run.varied) {
        const dimension = TC.run.dimensionOf(axis.name);
        const texts = { length: axis.values.length, at: (index) => TC.axisText(axis, index) };
        const move = (index) => {
          const at = state.at.slice();
          at[dimension] = index;
          TC.set({ at });
        };
        controls.push(
          axis.numeric
            ? TC.slider(TC.symbol(axis.name), texts, state.at[dimension], move)
            : TC.choice(
                TC.symbol(axis.name),
                axis.values.map((text, index) => [index, text]),
                state.at[dimension],
                (value) => move(Number(value)),
              ),
        );
      }
    else
      controls.push(
        TC.slider(
          "point",
          { length: run.points, at: (point) => `${point + 1} of ${run.points}` },
          state.at[0],
          (index) => TC.set({ at: [index] }),
        ),
      );
    TC.fill(host, controls);
  },
  // Colour of a value, and the bar that explains it.
  shade(values) {
    const [low, high] = TC.range(values);
    return {
      lo: low,
      hi: high,
      of: (value) =>
        TC.colour(high > low && Number.isFinite(value) ? (value - low) / (high - low) : 0.5),
    };
  },
  map(host) {
    if (!host) return;
    const run = TC.data.run;
    const state = TC.state;
    const quantity = run.numbers[state.q];
    const values = [];
    const xAxis = TC.run.axis(state.x);
    const yAxis = TC.run.axis(state.y);
    for (let point = 0; point < run.points; point++)
      if (TC.run.flag("status", point, state.level) === 1)
        values.push(quantity.v[point * run.nlevels + state.level]);
    const shade = TC.run.shade(values);
    const scale = TC.scale(values, quantity.units);
    const width = TC.width(host);
    const title = TC.h3(
      TC.withUnit(TC.symbol(state.q), scale) + (run.nlevels > 1 ? `, level ${state.level}` : ""),
    );
    const svg = run.grid
      ? TC.run.cells(width, xAxis, yAxis, shade, scale)
      : TC.run.scatter(width, xAxis, yAxis, shade, scale);
    const fixedAxes = run.grid
      ? run.varied.filter((axis) => axis.name !== state.x && axis.name !== state.y)
      : [];
    const note = fixedAxes.length
      ? "at " +
        fixedAxes
          .map(
            (axis) =>
              `${TC.symbol(axis.name)} = ` +
              TC.axisText(axis, state.at[TC.run.dimensionOf(axis.name)]),
          )
          .join(", ")
      : "";
    TC.fill(
      host,
      title,
      note ? TC.note(note) : null,
      svg,
      TC.run.bar(Math.min(width, 420), shade, scale),
      TC.run.key(width),
    );
  },
  patterns(svg) {
    const defs = svg.appendChild(TC.svgNode("defs"));
    const rotation = { patternTransform: "rotate(45)" };
    for (const [tone, colour] of [
      ["l", "rgba(255,255,255,.85)"],
      ["d", "rgba(0,0,0,.75)"],
    ]) {
      const add = (name, size, attributes, mark) =>
        defs.append(
          TC.svgNode(
            "pattern",
            {
              id: `${name}-${tone}`,
              width: size,
              height: size,
              patternUnits: "userSpaceOnUse",
              ...attributes,
            },
            mark,
          ),
        );
      add(
        "local",
        8,
        rotation,
        TC.svgNode("line", { x1: 0, y1: 0, x2: 0, y2: 8, stroke: colour, "stroke-width": 1.6 }),
      );
      add("global", 9, {}, TC.svgNode("circle", { cx: 3, cy: 3, r: 1.3, fill: colour }));
      add(
        "nothing",
        8,
        rotation,
        TC.svgNode("path", { d: "M0,0V8M0,0H8", stroke: colour, "stroke-width": 1.4 }),
      );
    }
  },
  // One piece of a pattern for the middle of a round point: a pattern would cut into its edge.
  dot(proof, x, y, radius, tone) {
    const colour = tone === "l" ? "rgba(255,255,255,.85)" : "rgba(0,0,0,.75)";
    const slash = `M${x - radius},${y + radius}L${x + radius},${y - radius}`;
    if (proof === "global") return TC.svgNode("circle", { cx: x, cy: y, r: 1.3, fill: colour });
    return TC.svgNode("path", {
      d:
        proof === "local"
          ? slash
          : `${slash}M${x - radius},${y - radius}L${x + radius},${y + radius}`,
      stroke: colour,
      "stroke-width": 1.5,
    });
  },
  PROOFS: ["failed", "nothing", "local", "global", "unique"],
  // Points in one cell: the median of their values and the weakest of their certificates.
  // A click takes the middle one. A single point is round.
  cell(svg, x, y, width, height, points, shade, scale, numbers, round = false) {
    const shapeOf = (inset, attributes) =>
      round
        ? TC.svgNode("circle", {
            cx: x + width / 2,
            cy: y + height / 2,
            r: Math.max(0, width / 2 - inset),
            ...attributes,
          })
        : TC.svgNode("rect", {
            x: x + inset,
            y: y + inset,
            width: Math.max(0, width - 2 * inset),
            height: Math.max(0, height - 2 * inset),
            ...attributes,
          });
    const state = TC.state;
    const point = points[points.length >> 1];
    const proofRanks = points.map((index) =>
      TC.run.PROOFS.indexOf(TC.run.proof(index, state.level)),
    );
    const proof = TC.run.PROOFS[Math.min(...proofRanks)];
    const values = points
      .filter((_, index) => proofRanks[index] > 0)
      .map((index) => TC.run.value(state.q, index, state.level))
      .sort((first, second) => first - second);
    const median = values.length ? values[values.length >> 1] : NaN;
    const colour = shade.of(median);
    const tone = TC.dark(colour) ? "l" : "d";
    const several = points.some((index) => TC.run.hasSeveral(index, state.level));
    const units = TC.data.run.numbers[state.q].units;
    const group = TC.svgNode("g", { class: "cell", "data-point": point });
    const countText = points.length > 1 ? `${points.length} points about ` : "";
    const lowest = TC.quantity(values[0], units);
    const highest = TC.quantity(values[values.length - 1], units);
    const rangeText = points.length > 1 ? ` (median; ${lowest} to ${highest})` : "";
    const tip = [
      countText + TC.run.words(TC.run.indicesOf(point)),
      `${TC.symbol(state.q)} = ${TC.quantity(median, units)}${rangeText}`,
      TC.data.proofs[proof],
    ].join("\n");
    group.append(
      TC.svgNode("title", {}, tip + (several ? "\nstarting points gave different solutions" : "")),
    );
    if (proof === "failed") {
      const right = x + width - 4;
      const bottom = y + height - 4;
      group.append(
        shapeOf(0, { fill: "var(--shade)", stroke: "var(--bad)" }),
        TC.svgNode("path", {
          d: `M${x + 4},${y + 4}L${right},${bottom}M${right},${y + 4}L${x + 4},${bottom}`,
          stroke: "var(--bad)",
          "stroke-width": 2,
        }),
      );
    } else {
      group.append(shapeOf(0, { fill: TC.css(colour) }));
      if (proof !== "unique")
        group.append(
          round
            ? TC.run.dot(proof, x + width / 2, y + height / 2, width / 3, tone)
            : shapeOf(0, { fill: `url(#${proof}-${tone})` }),
        );
      if (several)
        group.append(
          shapeOf(round ? 1 : 2.5, {
            fill: "none",
            stroke: "#d55e00",
            "stroke-width": round ? 2 : 3,
          }),
        );
      if (numbers) {
        const text = TC.number(median / scale.by, 3);
        const textWidth = 7.2 * text.length + 6;
        group.append(
          TC.svgNode("rect", {
            x: x + width / 2 - textWidth / 2,
            y: y + height / 2 - 8,
            width: textWidth,
            height: 16,
            fill: TC.css(colour),
          }),
          TC.svgNode(
            "text",
            {
              x: x + width / 2,
              y: y + height / 2 + 4.5,
              "text-anchor": "middle",
              style: `fill:${TC.dark(colour) ? "#fff" : "#111"}`,
            },
            text,
          ),
        );
      }
    }
    group.addEventListener("click", (event) =>
      TC.set(event.shiftKey ? { vs: TC.run.indicesOf(point) } : { at: TC.run.indicesOf(point) }),
    );
    svg.append(group);
  },
  // n places in groups of neighbours, `most` or fewer: [first, behind] of each.
  groups(count, maxGroups) {
    const size = Math.ceil(count / maxGroups);
    return [...Array(Math.ceil(count / size))].map((_, index) => [
      index * size,
      Math.min(count, (index + 1) * size),
    ]);
  },
  cells(width, xAxis, yAxis, shade, scale) {
    const state = TC.state;
    const xGroups = TC.run.groups(xAxis.values.length, 60);
    const yGroups = TC.run.groups(yAxis.values.length, 40);
    const columnCount = xGroups.length;
    const rowCount = yGroups.length;
    const xGroupSize = xGroups[0][1];
    const yGroupSize = yGroups[0][1];
    const xDimension = TC.run.dimensionOf(xAxis.name);
    const yDimension = TC.run.dimensionOf(yAxis.name);
    const labelLetters = yAxis.numeric
      ? 7
      : Math.max(...yAxis.values.map((value) => String(value).length)) * 1;
    const left = yAxis.numeric ? 66 : Math.min(150, 34 + 7 * labelLetters);
    const cellWidth = (width - left - 8) / columnCount;
    const cellHeight = Math.max(
      14,
      (6.4 * TC.axisTitle(yAxis).length) / rowCount,
      Math.min(62, 330 / rowCount, Math.max(26, cellWidth)),
    );
    const height = rowCount * cellHeight + 58; // room for the title of y
    const svg = TC.svgNode("svg", {
      width,
      height,
      tabindex: 0,
      role: "application",
      "aria-label": `map of ${TC.symbol(state.q)}; arrow keys move the point`,
    });
    TC.run.patterns(svg);
    const pointsIn = (column, row) => {
      const indices = state.at.slice();
      const points = [];
      for (
        indices[xDimension] = xGroups[column][0];
        indices[xDimension] < xGroups[column][1];
        indices[xDimension]++
      )
        for (
          indices[yDimension] = yGroups[row][0];
          indices[yDimension] < yGroups[row][1];
          indices[yDimension]++
        )
          points.push(TC.run.pointAt(indices));
      return points;
    };
    for (let column = 0; column < columnCount; column++)
      for (let row = 0; row < rowCount; row++)
        TC.run.cell(
          svg,
          left + column * cellWidth + 0.5,
          (rowCount - 1 - row) * cellHeight + 0.5,
          cellWidth - 1,
          cellHeight - 1,
          pointsIn(column, row),
          shade,
          scale,
          cellWidth > 46 && cellHeight > 22,
        );
    const frame = (indices, attrs) =>
      svg.append(
        TC.svgNode("rect", {
          x: left + Math.floor(indices[xDimension] / xGroupSize) * cellWidth + 1,
          y: (rowCount - 1 - Math.floor(indices[yDimension] / yGroupSize)) * cellHeight + 1,
          width: cellWidth - 2,
          height: cellHeight - 2,
          fill: "none",
          "pointer-events": "none",
          ...attrs,
        }),
      );
    frame(state.at, { stroke: "var(--halo)", "stroke-width": 6 });
    frame(state.at, { stroke: "var(--ink)", "stroke-width": 2.5 });
    if (
      state.vs &&
      state.vs.every(
        (value, indices) =>
          indices === xDimension || indices === yDimension || value === state.at[indices],
      )
    )
      frame(state.vs, { stroke: "var(--ink)", "stroke-width": 2.5, "stroke-dasharray": "5 4" });
    const labelStride = Math.max(
      1,
      Math.ceil(
        (Math.max(...xGroups.map(([column]) => TC.axisLabel(xAxis, column).length)) * 8) /
          cellWidth,
      ),
    );
    for (let column = 0; column < columnCount; column += labelStride)
      svg.append(
        TC.svgNode(
          "text",
          {
            x: left + (column + 0.5) * cellWidth,
            y: rowCount * cellHeight + 17,
            "text-anchor": "middle",
          },
          TC.axisLabel(xAxis, xGroups[column][0]),
        ),
      );
    const rowStride = Math.max(1, Math.ceil(15 / cellHeight));
    for (let row = 0; row < rowCount; row += rowStride)
      svg.append(
        TC.svgNode(
          "text",
          { x: left - 7, y: (rowCount - row - 0.5) * cellHeight + 4, "text-anchor": "end" },
          TC.axisLabel(yAxis, yGroups[row][0]),
        ),
      );
    svg.append(
      TC.svgNode(
        "text",
        {
          x: left + (columnCount * cellWidth) / 2,
          y: rowCount * cellHeight + 40,
          "text-anchor": "middle",
        },
        TC.axisTitle(xAxis),
      ),
      TC.svgNode(
        "text",
        {
          x: 12,
          y: (rowCount * cellHeight) / 2,
          "text-anchor": "middle",
          transform: `rotate(-90 12 ${(rowCount * cellHeight) / 2})`,
        },
        TC.axisTitle(yAxis),
      ),
    );
    svg.addEventListener("keydown", (event) => {
      const move = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[
        event.key
      ];
      if (!move) return;
      event.preventDefault();
      const indices = state.at.slice();
      indices[xDimension] = Math.min(
        xAxis.values.length - 1,
        Math.max(0, indices[xDimension] + xGroupSize * move[0]),
      );
      indices[yDimension] = Math.min(
        yAxis.values.length - 1,
        Math.max(0, indices[yDimension] + yGroupSize * move[1]),
      );
      TC.set({ at: indices });
      document.querySelector("#sweep svg[tabindex]")?.focus();
    });
    return svg;
  },
  scatter(width, xAxis, yAxis, shade, scale) {
    const run = TC.data.run;
    const state = TC.state;
    const place = (axis, point) =>
      axis.numeric ? axis.values[point] : axis.values.indexOf(axis.values[point]);
    const xDivisor = TC.axisScale(xAxis).by;
    const yDivisor = TC.axisScale(yAxis).by;
    const xs = Float64Array.from(
      { length: run.points },
      (_, point) => place(xAxis, point) / xDivisor,
    );
    const ys = Float64Array.from(
      { length: run.points },
      (_, point) => place(yAxis, point) / yDivisor,
    );
    const plot = new TC.Plot({
      width,
      height: 320,
      x: TC.pad(TC.range(xs), 0.06, xAxis.log),
      y: TC.pad(TC.range(ys), 0.06, yAxis.log),
      xlog: xAxis.log,
      ylog: yAxis.log,
      xlabel: TC.axisTitle(xAxis),
      ylabel: TC.axisTitle(yAxis),
    });
    TC.run.patterns(plot.svg);
    if (run.points > TC.run.MAX_MARKS) {
      // squares of 12 pixels instead of single points
      const bins = new Map();
      const size = 12;
      for (let point = 0; point < run.points; point++) {
        const column = Math.floor(plot.px(xs[point]) / size);
        const row = Math.floor(plot.py(ys[point]) / size);
        const key = `${column} ${row}`;
        bins.has(key) ? bins.get(key).push(point) : bins.set(key, [point]);
      }
      for (const [key, points] of bins) {
        const [column, row] = key.split(" ").map(Number);
        TC.run.cell(
          plot.over,
          column * size,
          row * size,
          size - 1,
          size - 1,
          points,
          shade,
          scale,
          false,
        );
      }
    } else {
      const halfSize = run.points > 150 ? 5 : 8; // many points must not hide one another
      for (let point = 0; point < run.points; point++)
        TC.run.cell(
          plot.over,
          plot.px(xs[point]) - halfSize,
          plot.py(ys[point]) - halfSize,
          2 * halfSize,
          2 * halfSize,
          [point],
          shade,
          scale,
          false,
          true,
        );
    }
    plot.over.append(
      TC.svgNode("circle", {
        cx: plot.px(xs[state.at[0]]),
        cy: plot.py(ys[state.at[0]]),
        r: 10,
        fill: "none",
        stroke: "var(--ink)",
        "stroke-width": 2.5,
        "pointer-events": "none",
      }),
    );
    return plot.svg;
  },
  bar(width, shade, scale) {
    const svg = TC.svgNode("svg", { width, height: 34, role: "img", "aria-label": "colours" });
    const count = 60;
    const left = 66;
    if (!(shade.hi > shade.lo)) return svg;
    for (let index = 0; index < count; index++)
      svg.append(
        TC.svgNode("rect", {
          x: left + (index * (width - left - 30)) / count,
          y: 2,
          width: (width - left - 30) / count + 0.6,
          height: 11,
          fill: TC.css(TC.colour((index + 0.5) / count)),
        }),
      );
    for (const fraction of [0, 0.5, 1])
      svg.append(
        TC.svgNode(
          "text",
          { x: left + fraction * (width - left - 30), y: 28, "text-anchor": "middle" },
          TC.number((shade.lo + fraction * (shade.hi - shade.lo)) / scale.by, 3),
        ),
      );
    svg.append(TC.svgNode("text", { x: width - 24, y: 12, class: "soft" }, scale.unit));
    return svg;
  },
  key() {
    const run = TC.data.run;
    const state = TC.state;
    const present = new Set();
    let several = false;
    for (let point = 0; point < run.points; point++) {
      present.add(TC.run.proof(point, state.level));
      several = several || TC.run.hasSeveral(point, state.level);
    }
    const box = (fill, attributes = {}) =>
      TC.svgNode("rect", {
        x: 1,
        y: 1,
        width: 24,
        height: 14,
        fill,
        stroke: "var(--soft)",
        ...attributes,
      });
    const entry = (shapes, text) =>
      TC.entry(26, 16, shapes, text, "vertical-align:-3px;margin-right:5px");
    const shapes = (proof) =>
      proof === "failed"
        ? [
            box("var(--shade)"),
            TC.svgNode("path", {
              d: "M3,3L23,13M23,3L3,13",
              stroke: "var(--bad)",
              "stroke-width": 2,
            }),
          ]
        : [box("#9aa"), proof === "unique" ? "" : box(`url(#${proof}-d)`)];
    const legend = TC.legend(
      ...TC.run.PROOFS.filter((proof) => present.has(proof))
        .reverse()
        .map((proof) => entry(shapes(proof), TC.data.proofs[proof])),
    );
    if (several)
      legend.append(
        entry(
          [box("#9aa", { stroke: "#d55e00", "stroke-width": 3 })],
          "starting points gave different solutions",
        ),
      );
    return legend;
  },
  // Marks of single points on the map and beside it; of more points a picture shows ranges.
  MAX_MARKS: 1500,
  MAX_CURVES: 14,
  // Least, median and greatest value at every x, or in 120 parts of its range.
  spread(samples) {
    const xs = new Set(samples.map((sample) => sample.x));
    const [low, high] = TC.range(xs);
    const binCount = 120;
    const middleOfBin = (x) => {
      const bin = Math.min(binCount - 1, Math.floor(((x - low) / (high - low)) * binCount));
      return low + ((bin + 0.5) / binCount) * (high - low);
    };
    const valuesAt = new Map();
    for (const sample of samples) {
      if (!Number.isFinite(sample.y)) continue;
      const x = xs.size <= binCount ? sample.x : middleOfBin(sample.x);
      if (!valuesAt.has(x)) valuesAt.set(x, []);
      valuesAt.get(x).push(sample.y);
    }
    return [...valuesAt]
      .sort((first, second) => first[0] - second[0])
      .map(([x, values]) => {
        values.sort((first, second) => first - second);
        return {
          x,
          low: values[0],
          median: values[values.length >> 1],
          high: values[values.length - 1],
        };
      });
  },
  // The curves over an axis: samples of points by series, or of the whole sweep in one series.
  series(xAxis, seriesAxis) {
    return TC.data.run.grid
      ? TC.run.gridSeries(xAxis, seriesAxis)
      : TC.run.listSeries(xAxis, seriesAxis);
  },
  gridSeries(xAxis, seriesAxis) {
    const state = TC.state;
    const xDimension = TC.run.dimensionOf(xAxis.name);
    const seriesDimension = seriesAxis ? TC.run.dimensionOf(seriesAxis.name) : -1;
    const divisor = TC.axisScale(xAxis).by;
    const seriesCount = seriesAxis ? seriesAxis.values.length : 1;
    return [...Array(seriesCount).keys()].map((seriesIndex) => {
      const samples = Array.from(xAxis.values, (value, index) => {
        const indices = state.at.slice();
        indices[xDimension] = index;
        if (seriesAxis) indices[seriesDimension] = seriesIndex;
        return { point: TC.run.pointAt(indices), x: xAxis.numeric ? value / divisor : index };
      });
      return {
        name: seriesAxis ? TC.axisWords(seriesAxis, seriesIndex) : "",
        samples,
        isCurrent: !seriesAxis || seriesIndex === state.at[seriesDimension],
      };
    });
  },
  listSeries(xAxis, seriesAxis) {
    const divisor = TC.axisScale(xAxis).by;
    const groups = new Map();
    for (let point = 0; point < TC.data.run.points; point++) {
      const key = seriesAxis ? TC.axisWords(seriesAxis, point) : "";
      const value = xAxis.values[point];
      const x = xAxis.numeric ? value / divisor : xAxis.values.indexOf(value);
      if (!groups.has(key)) groups.set(key, []);
      groups.get(key).push({ point, x });
    }
    return [...groups].map(([name, samples]) => ({
      name,
      samples: samples.sort((first, second) => first.x - second.x),
      isCurrent: samples.some((sample) => sample.point === TC.state.at[0]),
    }));
  },
  curves(host) {
    const run = TC.data.run;
    const state = TC.state;
    if (!state.x) return;
    const quantity = run.numbers[state.q];
    const xAxis = TC.run.axis(state.x);
    const seriesAxis = state.by && state.by !== state.x ? TC.run.axis(state.by) : null;
    const series = TC.run.series(xAxis, seriesAxis);
    const samples = series.flatMap((curve) => curve.samples);
    for (const sample of samples) {
      const isSolved = TC.run.flag("status", sample.point, state.level) === 1;
      sample.value = isSolved ? TC.run.value(state.q, sample.point, state.level) : NaN;
    }
    const scale = TC.scale(
      samples.map((sample) => sample.value),
      quantity.units,
    );
    for (const sample of samples) sample.y = sample.value / scale.by;

    const isCrowded = series.length > TC.run.MAX_CURVES || samples.length > TC.run.MAX_MARKS;
    let shownCurves = series;
    if (samples.length > TC.run.MAX_MARKS * TC.run.MAX_CURVES) shownCurves = [];
    else if (isCrowded)
      shownCurves = series.filter(
        (curve) => curve.isCurrent && curve.samples.length <= TC.run.MAX_MARKS,
      );
    const items = isCrowded ? TC.run.spreadItems(samples) : [];
    shownCurves.forEach((curve, index) =>
      items.push(...TC.run.curveItems(curve, TC.series(index), TC.SHAPES[index % 4], xAxis)),
    );
    items.push(
      ...TC.run.ambiguousItems(shownCurves.flatMap((curve) => curve.samples)),
      ...TC.run.currentItems(samples),
    );

    const notes = [];
    if (isCrowded) {
      const over = seriesAxis ? ` over ${TC.symbol(seriesAxis.name)}` : "";
      const fixedText = seriesAxis
        ? `${TC.symbol(seriesAxis.name)} of the point below`
        : "the other numbers as at the point below";
      notes.push(`grey: from the least to the greatest value, and the median${over}`);
      if (shownCurves.length) notes.push(`curve: ${fixedText}`);
    } else {
      if (seriesAxis) notes.push(`one curve for each ${TC.symbol(seriesAxis.name)}`);
      notes.push("filled marks: proved unique");
    }
    notes.push("ring: the point below");
    TC.fill(
      host,
      TC.h3(`${TC.symbol(state.q)} over ${TC.symbol(xAxis.name)}`),
      TC.note(notes.join("; ")),
      TC.part.panel(
        {
          labels: [TC.axisTitle(xAxis), TC.withUnit(TC.symbol(state.q), scale)],
          log: [xAxis.log, false],
          limits: [null, null],
          ticks: TC.run.ticks(xAxis),
          items,
          high: 330,
        },
        TC.width(host),
      ),
    );
  },
  spreadItems(samples) {
    const ranges = TC.run.spread(samples);
    const x = ranges.map((range) => range.x);
    const low = ranges.map((range) => range.low);
    const high = ranges.map((range) => range.high);
    const median = ranges.map((range) => range.median);
    return [
      {
        kind: "fill",
        x: [...x, ...x.slice().reverse()],
        y: [...low, ...high.reverse()],
        colour: "var(--soft)",
        alpha: 0.22,
      },
      { kind: "line", x, y: median, colour: "var(--soft)", width: 2 },
    ];
  },
  // The line and the marks of a curve; points drawn at random have no line.
  curveItems(curve, look, shape, xAxis) {
    const samples = curve.samples;
    const positions = {
      x: samples.map((sample) => sample.x),
      y: samples.map((sample) => sample.y),
    };
    const units = TC.data.run.numbers[TC.state.q].units;
    const indicesOf = (index) => TC.run.indicesOf(samples[index].point);
    const isUnique = (index) => TC.run.proof(samples[index].point, TC.state.level) === "unique";
    const line = {
      kind: "line",
      ...positions,
      colour: look.stroke,
      dash: look["stroke-dasharray"],
      width: curve.isCurrent ? 2.8 : 1.5,
      alpha: curve.isCurrent ? 1 : 0.75,
      label: curve.name,
    };
    const marks = {
      kind: "marks",
      ...positions,
      shape,
      r: samples.length > 40 ? 2 : 3.6,
      stroke: look.stroke,
      fill: (index) => (isUnique(index) ? look.stroke : "var(--bg)"),
      tip: (index) =>
        `${TC.run.words(indicesOf(index))}\n${TC.quantity(samples[index].value, units)}`,
      pick: (index) => TC.set({ at: indicesOf(index) }),
    };
    return xAxis.drawn ? [marks] : [line, marks];
  },
  ambiguousItems(samples) {
    const ambiguous = samples.filter(
      (sample) => TC.run.hasSeveral(sample.point, TC.state.level) && Number.isFinite(sample.value),
    );
    if (!ambiguous.length) return [];
    return [
      {
        kind: "line",
        x: ambiguous.map((sample) => sample.x),
        y: ambiguous.map((sample) => sample.y),
        dash: "none",
        mark: "o",
        open: true,
        size: 6,
        colour: "#d55e00",
        label: "starting points gave different solutions",
      },
    ];
  },
  // The ring round the point that the page shows.
  currentItems(samples) {
    const current = samples.find((sample) => sample.point === TC.run.pointAt(TC.state.at));
    if (!current) return [];
    return [
      {
        kind: "marks",
        x: [current.x],
        y: [current.y],
        shape: "circle",
        r: 8,
        stroke: "var(--ink)",
        fill: () => "none",
      },
    ];
  },
  MAX_TICKS: 9,
  // Ticks of a swept parameter: its texts, or some of its values where their ratios are equal.
  ticks(axis) {
    const values = [...new Set(axis.values)];
    if (!axis.numeric) return [values.map((_, index) => index), values];
    if (!axis.log) return null;
    const stride = Math.ceil(values.length / TC.run.MAX_TICKS);
    const indices = values
      .filter((_, index) => index % stride === 0)
      .map((value) => axis.values.indexOf(value));
    const { by: divisor } = TC.axisScale(axis);
    return [
      indices.map((index) => axis.values[index] / divisor),
      indices.map((index) => TC.axisLabel(axis, index)),
    ];
  },
  accuracy(host) {
    const run = TC.data.run;
    const state = TC.state;
    const point = TC.run.pointAt(state.at);
    const parts = [];
    const width = TC.width(host);
    if (run.nlevels > 1) {
      // the table of the levels has eight columns, for which half of the width is too little
      parts.push(
        TC.panel(TC.run.changes(Math.min(width, 760), point)),
        TC.panel(TC.run.costs(point)),
      );
    } else {
      parts.push(TC.note("The study has one mesh; add levels to see how the numbers converge."));
    }
    for (const part of TC.data.solvers || []) parts.push(TC.part[part.part](part, width));
    TC.fill(host, parts);
  },
  ROUNDING: 1e-12, // relative changes below it are none
  CONVERGED: [
    "u_T_max",
    "slip_length",
    "friction_resultant",
    "energy",
    "error_estimate",
    "error_bound_relative",
  ],
  changes(width, point) {
    // The longest edge tells a mesh only where every edge is halved.
    const run = TC.data.run;
    const levels = TC.run.levels(point);
    const halved = levels.h_max.every(
      (size, level) => level === 0 || size < 0.9 * levels.h_max[level - 1],
    );
    const sizes = halved ? levels.h_max : Array.from(levels.n_dof, (count) => 1 / Math.sqrt(count));
    const scale = TC.scale(sizes, halved ? run.units.h_max : "1");
    const series = [];
    for (const name of TC.run.CONVERGED.filter((quantity) => run.numbers[quantity])) {
      const values = sizes.map((_, level) =>
        TC.run.flag("status", point, level) === 1 ? TC.run.value(name, point, level) : NaN,
      );
      const lastValue = Math.abs(values[values.length - 1]) || 1;
      const changes = name.startsWith("error_")
        ? values
        : values.map((value, level) =>
            level === 0 ? NaN : Math.abs(value - values[level - 1]) / lastValue,
          );
      series.push({
        name,
        xs: sizes.map((size) => size / scale.by),
        ys: changes.map((change) => (change > TC.run.ROUNDING ? change : NaN)),
        title: TC.symbol(name),
      });
    }
    const changing = series.filter((curve) => curve.ys.some((change) => change > 0));
    const constant = series
      .filter((curve) => !changing.includes(curve))
      .map((curve) => curve.title);
    if (!changing.length)
      return [
        TC.h3("Convergence over the levels"),
        TC.note("The numbers do not change from level to level."),
      ];
    const xs = series[0].xs.slice(1);
    const high = Math.max(...xs);
    const low = Math.min(...xs);
    const top = Math.max(...changing.flatMap((curve) => curve.ys.filter((change) => change > 0)));
    const items = [];
    for (const order of [1, 2])
      items.push(
        {
          kind: "line",
          x: [low, high],
          y: [top * (low / high) ** order, top],
          colour: "var(--soft)",
          width: 1,
          dash: "3 3",
        },
        {
          kind: "note",
          x: [low],
          y: [top * (low / high) ** order],
          shift: [4, 9],
          text: `order ${order}`,
        },
      );
    const orderText = (curve) => {
      const last = curve.ys.length - 1;
      if (last < 2 || !(halved || curve.name.startsWith("error_"))) return "";
      const order =
        Math.log(curve.ys[last - 1] / curve.ys[last]) /
        Math.log(curve.xs[last - 1] / curve.xs[last]);
      if (!Number.isFinite(order)) return "";
      return `: last order ${order.toFixed(1).replace("-", "−")}?`;
    };
    changing.forEach((curve, curveIndex) => {
      const seriesLook = TC.series(curveIndex);
      items.push({
        kind: "line",
        x: curve.xs,
        y: curve.ys,
        colour: seriesLook.stroke,
        dash: seriesLook["stroke-dasharray"],
        width: 2,
        mark: "os^D"[curveIndex % 4],
        size: 4,
        label: curve.title + orderText(curve),
      });
    });
    const panel = TC.part.panel(
      {
        title: "Convergence over the levels, of this point",
        labels: [
          halved ? TC.withUnit("largest edge h", scale) : "1/√DOFs",
          "relative change from the level before" +
            (changing.some((curve) => curve.name.startsWith("error_")) ? ", or error" : ""),
        ],
        log: [true, true],
        limits: [null, null],
        items,
        high: 300,
      },
      width,
    );
    return [
      panel,
      constant.length ? TC.note(`${constant.join(", ")}: does not change`) : null,
      TC.note(
        "Where slip meets stick or an end is constrained expect order 1 for ∫ξ and slip length, " +
          "up to 2 for energy and slip without singular corners. ?: two steps, not judged. " +
          "The orders to expect at every corner: tcstudy converge.",
      ),
    ];
  },
  STAGES: [
    ["time_mesh", "mesh"],
    ["time_assemble", "matrices"],
    ["time_condense", "condensing, all points"],
    ["time_solve", "contact, all points"],
  ],
  // Sizes of the levels, of the geometry of the point, and their wall times of the whole sweep.
  costs(point) {
    const run = TC.data.run;
    const levels = TC.run.levels(point);
    const points = [...Array(run.points).keys()];
    const sum = (name, level) =>
      run.levels[name]
        ? run.levels[name][level]
        : points.reduce((total, point) => total + (TC.run.value(name, point, level) || 0), 0);
    const rows = levels.h_max.map((size, level) => [
      level,
      TC.quantity(size, run.units.h_max, 3),
      levels.n_dof[level],
      levels.n_contact[level],
      ...TC.run.STAGES.map(([name]) => TC.quantity(sum(name, level), "s", 2)),
    ]);
    return [
      TC.h3("Levels, and their wall time in the whole sweep"),
      TC.wideTable(
        [
          "level",
          "largest edge",
          "DOFs",
          "on the contact line",
          ...TC.run.STAGES.map(([, words]) => words),
        ],
        rows,
      ),
    ];
  },
  NOT_TABLED: RegExp(
    "^(time_condense|lambda_1|omega|evaluations|heat_balance|inclusion_rounding|.*_error)",
  ),
  rows(host) {
    // a long table is made again only where its numbers or its order change
    const key = `${TC.state.level} ${TC.state.sort} ${TC.state.down}`;
    const currentPoint = TC.run.pointAt(TC.state.at);
    if (host.dataset.key === key && host.firstChild) {
      host.querySelector("tr.chosen")?.classList.remove("chosen");
      host.querySelector(`tr[data-row="${currentPoint}"]`)?.classList.add("chosen");
      return;
    }
    host.dataset.key = key;
    const run = TC.data.run;
    const state = TC.state;
    const level = state.level;
    const points = [...Array(run.points).keys()];
    const columns = [];
    for (const axis of run.axes) {
      const dimension = TC.run.dimensionOf(axis.name);
      columns.push({
        title: TC.axisTitle(axis),
        csv: axis.name + (axis.units !== "1" ? ` [${axis.units}]` : ""),
        left: !axis.numeric,
        get: (point) => axis.values[TC.run.indicesOf(point)[dimension]],
        text: (point) => TC.axisLabel(axis, TC.run.indicesOf(point)[dimension]),
      });
    }
    for (const name of Object.keys(run.numbers)) {
      if (TC.run.NOT_TABLED.test(name)) continue;
      const quantity = run.numbers[name];
      const scale = TC.scale(
        points.map((point) => quantity.v[point * run.nlevels + level]),
        quantity.units,
      );
      columns.push({
        title: TC.withUnit(TC.symbol(name), scale),
        csv: name + (quantity.units !== "1" ? ` [${quantity.units}]` : ""),
        get: (point) => quantity.v[point * run.nlevels + level],
        text: (point) => TC.number(quantity.v[point * run.nlevels + level] / scale.by),
      });
    }
    const addWords = (title, get) => columns.push({ title, left: true, get, text: get });
    const reason = (point) => run.reasons[run.reason[point * run.nlevels + level]];
    addWords("certified", (point) => TC.run.proof(point, level));
    addWords("status", (point) => run.statuses[TC.run.flag("status", point, level)]);
    if (points.some(reason)) addWords("reason", reason);
    columns.forEach((column, index) => {
      column.minor = index > 6; // more do not fit on paper
    });
    const table = TC.table({
      columns,
      rows: points,
      ...TC.sorting(),
      chosen: (point) => point === TC.run.pointAt(state.at),
      pick: (point) => TC.set({ at: TC.run.indicesOf(point) }),
    });
    const csv = () => TC.saveTable(`${TC.fileName()}-level${level}.csv`, columns, table.order);
    const scroll = host.querySelector(".scroll")?.scrollTop || 0;
    const box = TC.el("div", { class: "scroll" }, table.node);
    const countText =
      run.points > TC.MAX_ROWS
        ? `the first ${TC.MAX_ROWS} in this order of ${run.points}`
        : String(run.points);
    const levelText = run.nlevels > 1 ? ` on level ${level}` : "";
    TC.fill(
      host,
      TC.el(
        "div",
        { class: "controls noprint" },
        TC.el("button", { onclick: csv, "aria-label": "csv" }, "Download as CSV"),
        TC.el(
          "span",
          { class: "note" },
          `${countText} points${levelText}; a click on a row shows the point`,
        ),
      ),
      box,
    );
    box.scrollTop = scroll;
  },
};
