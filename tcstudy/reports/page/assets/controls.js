// What all parts share: the state (kept in the address), controls, tables.
TC.state = Object.create(null);
TC.readState = () => Object.fromEntries(new URLSearchParams(location.hash.slice(1)));
TC.writeState = function () {
  const words = new URLSearchParams();
  for (const key in TC.state)
    if (TC.state[key] !== undefined && TC.state[key] !== null && TC.state[key] !== "")
      words.set(key, Array.isArray(TC.state[key]) ? TC.state[key].join(",") : TC.state[key]);
  const hash = "#" + words.toString().replace(/%2C/g, ",");
  if (hash !== location.hash) history.replaceState(null, "", hash);
};
TC.set = function (changes) {
  Object.assign(TC.state, changes.at ? { eq: 0 } : {}, changes);
  TC.writeState();
  TC.draw();
};
TC.width = (node, most = 1200) =>
  Math.max(260, Math.min(most, Math.floor(node.getBoundingClientRect().width) || 600));

TC.choice = function (label, options, value, change, title) {
  const select = TC.el(
    "select",
    { onchange: (e) => change(e.target.value) },
    options.map(([key, text]) =>
      TC.el("option", { value: key, selected: String(key) === String(value) }, text),
    ),
  );
  return TC.el("label", { title }, label, select);
};
// options: an array of texts, or its length and at(i).
TC.slider = function (label, options, value, change) {
  const range = TC.el("input", {
    type: "range",
    min: 0,
    max: options.length - 1,
    step: 1,
    value,
    "aria-label": label,
    oninput: (e) => change(Number(e.target.value)),
  });
  return TC.el(
    "label",
    {},
    TC.el("span", {}, `${label}: `, TC.el("output", {}, options.at(value))),
    range,
  );
};
// A number of an address below a count, or another one.
TC.whole = (text, count, other) => {
  const n = Number(text);
  return text !== undefined && text !== null && Number.isInteger(n) && n >= 0 && n < count
    ? n
    : other;
};
TC.panel = (...children) => TC.el("div", { class: "panel" }, ...children);
TC.h3 = (text) => TC.el("h3", {}, text);
TC.note = (...words) => TC.el("p", { class: "note" }, ...words);
TC.legend = (...words) => TC.el("p", { class: "legend" }, ...words);
TC.titled = (words, scale) => words + (scale.unit ? ` [${scale.unit}]` : "");
// A part of a page under its heading.
TC.section = function (title, id) {
  const body = TC.el("div", { id });
  document.getElementById("main").append(TC.el("h2", {}, title), body);
  return body;
};
// A key's entry: a small picture of shapes, and what they stand for.
TC.entry = (width, height, shapes, text, style = "margin-right:5px") =>
  TC.el(
    "span",
    { style: "display:inline-block;margin-right:14px" },
    TC.svgNode("svg", { width, height, style: `display:inline-block;${style}` }, ...shapes),
    text,
  );
TC.dash = (width, y, look) =>
  TC.svgNode("line", { x1: 0, x2: width, y1: y, y2: y, "stroke-width": 2, ...look });
TC.swatch = (fill, text) =>
  TC.entry(20, 10, [TC.svgNode("rect", { width: 20, height: 10, fill })], text);
// Put children into a host without losing the focus of the control that was used.
TC.fill = function (host, ...children) {
  const active = document.activeElement;
  const inside = host.contains(active) ? active.getAttribute("aria-label") : null;
  host.replaceChildren(...children.flat().filter((c) => c !== null && c !== undefined));
  if (inside) host.querySelector(`[aria-label="${CSS.escape(inside)}"]`)?.focus();
};

TC.MOST_ROWS = 300; // that a table shows; what is saved has all
// A table that sorts by its columns; columns: {title, get(row), text(row), left, minor}; minor ones are not printed.
TC.table = function ({ columns, rows, sort, down, onsort, chosen, pick }) {
  const order = rows.slice();
  const cls = (c) => (c.left ? "text" : "") + (c.minor ? " noprint" : "");
  if (columns[sort]) {
    const key = columns[sort].get;
    const rank = (v) => (typeof v === "number" && Number.isNaN(v) ? -Infinity : v);
    order.sort((a, b) => {
      const u = rank(key(a));
      const v = rank(key(b));
      return (u < v ? -1 : u > v ? 1 : 0) * (down ? -1 : 1);
    });
  }
  const head = columns.map((c, i) =>
    TC.el(
      "th",
      { class: cls(c), "aria-sort": i === sort ? (down ? "descending" : "ascending") : undefined },
      TC.el(
        "button",
        { title: c.long || "sort", "aria-label": `sort by ${c.title}`, onclick: () => onsort(i) },
        c.title + (i === sort ? (down ? " ▼" : " ▲") : ""),
      ),
    ),
  );
  const body = order.slice(0, TC.MOST_ROWS).map((row) =>
    TC.el(
      "tr",
      {
        "data-row": typeof row === "number" ? row : undefined,
        class: [chosen && chosen(row) ? "chosen" : "", pick ? "link" : ""].join(" "),
        onclick: pick ? () => pick(row) : undefined,
      },
      columns.map((c) =>
        TC.el("td", { class: cls(c) }, c.text ? c.text(row) : TC.number(c.get(row))),
      ),
    ),
  );
  return {
    node: TC.el("table", {}, TC.el("thead", {}, TC.el("tr", {}, head)), TC.el("tbody", {}, body)),
    order,
  };
};
// A table as it is; look(column, text, row): class of a cell, without a row that of the head.
TC.plain = function (head, rows, look = () => null) {
  const line = (tag, row, i) =>
    TC.el(
      "tr",
      {},
      row.map((t, k) =>
        TC.el(tag, { class: look(k, t, i) || undefined }, typeof t === "number" ? String(t) : t),
      ),
    );
  return TC.el(
    "table",
    {},
    TC.el("thead", {}, line("th", head)),
    TC.el(
      "tbody",
      {},
      rows.map((row, i) => line("td", row, i)),
    ),
  );
};
TC.wide = (...table) => TC.el("div", { class: "wide-table" }, TC.plain(...table));
// What TC.table needs to sort by the state's values of two names; a click on the sorted column turns it round.
TC.sorting = function (by = "sort", down = "down", first = -1) {
  const s = TC.state;
  const sort = s[by] === undefined ? first : Number(s[by]);
  const turned = Number(s[down]) === 1;
  return {
    sort,
    down: turned,
    onsort: (i) => TC.set({ [by]: i, [down]: i === sort && !turned ? 1 : 0 }),
  };
};
TC.saveTable = (name, columns, rows) =>
  TC.save(
    name,
    TC.CSV(
      columns.map((c) => c.csv || c.title),
      rows.map((row) => columns.map((c) => c.get(row))),
    ),
  );
TC.fileName = () => TC.data.file.replace(/\.nc$/, "");
TC.facts = (pairs) =>
  TC.el(
    "table",
    { class: "facts" },
    TC.el(
      "tbody",
      {},
      pairs
        .filter((p) => p[1] !== undefined && p[1] !== "")
        .map(([k, v]) => TC.el("tr", {}, TC.el("th", {}, k), TC.el("td", {}, v))),
    ),
  );

TC.provenance = function (host) {
  const d = TC.data;
  const words = {
    history: "made by",
    source: "program",
    git_commit: "commit of the study",
    study_sha256: "checksum of the study",
    references: "method",
    institution: "institution",
    Conventions: "conventions",
  };
  const pairs = Object.entries(words)
    .filter(([k]) => d.provenance[k] && d.provenance[k] !== "unspecified")
    .map(([k, t]) => [t, d.provenance[k]]);
  pairs.unshift(["file", d.file]);
  pairs.push(
    ["solver", `${d.solver}, tolerance ${TC.number(d.tolerance)}`],
    [
      "versions",
      Object.entries(d.versions)
        .map((p) => p.join(" "))
        .join(", "),
    ],
  );
  if (d.overrides.length) pairs.push(["set on the command line", d.overrides.join("  ")]);
  const left = {
    levels: "contact lines of the coarser levels",
    live: "the data of the live mode",
    body: "temperature and displacement of the body",
    lines: "all contact lines",
  };
  if (d.without.length)
    pairs.push([
      "left out of this page",
      d.without.map((k) => left[k]).join(", ") + "; the file has it",
    ]);
  host.append(TC.h3("Where it comes from"), TC.facts(pairs));
  host.append(
    TC.el(
      "details",
      { open: false },
      TC.el("summary", {}, "The study (YAML)"),
      TC.el(
        "button",
        { class: "noprint", onclick: () => TC.save("study.yaml", d.yaml, "text/yaml") },
        "download",
      ),
      TC.el("pre", {}, d.yaml),
    ),
  );
};
