// Shared by all parts: the state, which the address keeps, controls and tables.
TC.state = Object.create(null);
TC.readState = () => Object.fromEntries(new URLSearchParams(location.hash.slice(1)));
TC.writeState = function () {
  const parameters = new URLSearchParams();
  for (const key in TC.state)
    if (TC.state[key] !== undefined && TC.state[key] !== null && TC.state[key] !== "")
      parameters.set(key, Array.isArray(TC.state[key]) ? TC.state[key].join(",") : TC.state[key]);
  const hash = "#" + parameters.toString().replace(/%2C/g, ",");
  if (hash !== location.hash) history.replaceState(null, "", hash);
};
TC.set = function (changes) {
  Object.assign(TC.state, changes.at ? { eq: 0 } : {}, changes);
  TC.writeState();
  TC.draw();
};
TC.width = (node, maximum = 1200) =>
  Math.max(260, Math.min(maximum, Math.floor(node.getBoundingClientRect().width) || 600));

TC.choice = function (label, options, value, onChange, title) {
  const select = TC.el(
    "select",
    { onchange: (event) => onChange(event.target.value) },
    options.map(([key, text]) =>
      TC.el("option", { value: key, selected: String(key) === String(value) }, text),
    ),
  );
  return TC.el("label", { title }, label, select);
};
// options: an array of texts, or its length and at(i).
TC.slider = function (label, options, value, onChange) {
  const range = TC.el("input", {
    type: "range",
    min: 0,
    max: options.length - 1,
    step: 1,
    value,
    "aria-label": label,
    oninput: (event) => onChange(Number(event.target.value)),
  });
  return TC.el(
    "label",
    {},
    TC.el("span", {}, `${label}: `, TC.el("output", {}, options.at(value))),
    range,
  );
};
// A number of the address if it is an index below the count, else the fallback.
TC.indexBelow = (text, count, fallback) => {
  const index = Number(text);
  return text !== undefined &&
    text !== null &&
    Number.isInteger(index) &&
    index >= 0 &&
    index < count
    ? index
    : fallback;
};
TC.panel = (...children) => TC.el("div", { class: "panel" }, ...children);
TC.h3 = (text) => TC.el("h3", {}, text);
TC.note = (...words) => TC.el("p", { class: "note" }, ...words);
TC.legend = (...words) => TC.el("p", { class: "legend" }, ...words);
TC.withUnit = (text, scale) => text + (scale.unit ? ` [${scale.unit}]` : "");
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
  const focused = document.activeElement;
  const label = host.contains(focused) ? focused.getAttribute("aria-label") : null;
  host.replaceChildren(...children.flat().filter((child) => child !== null && child !== undefined));
  if (label) host.querySelector(`[aria-label="${CSS.escape(label)}"]`)?.focus();
};

TC.MAX_ROWS = 300; // rows that a table shows; a saved table has all
// A table that sorts by its columns: {title, get(row), text(row), left, minor}.
// Minor columns are not printed.
TC.table = function ({ columns, rows, sort, down, onsort, chosen, pick }) {
  const order = rows.slice();
  const cellClass = (column) => (column.left ? "text" : "") + (column.minor ? " noprint" : "");
  if (columns[sort]) {
    const key = columns[sort].get;
    const rank = (value) => (typeof value === "number" && Number.isNaN(value) ? -Infinity : value);
    order.sort((a, b) => {
      const first = rank(key(a));
      const second = rank(key(b));
      return (first < second ? -1 : first > second ? 1 : 0) * (down ? -1 : 1);
    });
  }
  const head = columns.map((column, index) =>
    TC.el(
      "th",
      {
        class: cellClass(column),
        "aria-sort": index === sort ? (down ? "descending" : "ascending") : undefined,
      },
      TC.el(
        "button",
        {
          title: column.long || "sort",
          "aria-label": `sort by ${column.title}`,
          onclick: () => onsort(index),
        },
        column.title + (index === sort ? (down ? " ▼" : " ▲") : ""),
      ),
    ),
  );
  const body = order.slice(0, TC.MAX_ROWS).map((row) =>
    TC.el(
      "tr",
      {
        "data-row": typeof row === "number" ? row : undefined,
        class: [chosen && chosen(row) ? "chosen" : "", pick ? "link" : ""].join(" "),
        onclick: pick ? () => pick(row) : undefined,
      },
      columns.map((column) =>
        TC.el(
          "td",
          { class: cellClass(column) },
          column.text ? column.text(row) : TC.number(column.get(row)),
        ),
      ),
    ),
  );
  return {
    node: TC.el("table", {}, TC.el("thead", {}, TC.el("tr", {}, head)), TC.el("tbody", {}, body)),
    order,
  };
};
// A table as it is; look(column, text, row): class of a cell, without a row that of the head.
TC.plainTable = function (head, rows, cellClass = () => null) {
  const line = (tag, cells, rowIndex) =>
    TC.el(
      "tr",
      {},
      cells.map((cell, columnIndex) =>
        TC.el(
          tag,
          { class: cellClass(columnIndex, cell, rowIndex) || undefined },
          typeof cell === "number" ? String(cell) : cell,
        ),
      ),
    );
  return TC.el(
    "table",
    {},
    TC.el("thead", {}, line("th", head)),
    TC.el(
      "tbody",
      {},
      rows.map((row, rowIndex) => line("td", row, rowIndex)),
    ),
  );
};
TC.wideTable = (...table) => TC.el("div", { class: "wide-table" }, TC.plainTable(...table));
// Options of TC.table that keep column and direction of the order in the state.
// A click on the sorted column reverses the order.
TC.sorting = function (columnKey = "sort", directionKey = "down", initial = -1) {
  const state = TC.state;
  const column = state[columnKey] === undefined ? initial : Number(state[columnKey]);
  const isDescending = Number(state[directionKey]) === 1;
  return {
    sort: column,
    down: isDescending,
    onsort: (index) =>
      TC.set({ [columnKey]: index, [directionKey]: index === column && !isDescending ? 1 : 0 }),
  };
};
TC.saveTable = (name, columns, rows) =>
  TC.save(
    name,
    TC.CSV(
      columns.map((column) => column.csv || column.title),
      rows.map((row) => columns.map((column) => column.get(row))),
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
        .filter((pair) => pair[1] !== undefined && pair[1] !== "")
        .map(([name, value]) => TC.el("tr", {}, TC.el("th", {}, name), TC.el("td", {}, value))),
    ),
  );

TC.provenance = function (host) {
  const data = TC.data;
  const titles = {
    history: "made by",
    source: "program",
    git_commit: "commit of the study",
    study_sha256: "checksum of the study",
    references: "method",
    institution: "institution",
    Conventions: "conventions",
  };
  const pairs = Object.entries(titles)
    .filter(([key]) => data.provenance[key] && data.provenance[key] !== "unspecified")
    .map(([key, title]) => [title, data.provenance[key]]);
  pairs.unshift(["file", data.file]);
  pairs.push(
    ["solver", `${data.solver}, tolerance ${TC.number(data.tolerance)}`],
    [
      "versions",
      Object.entries(data.versions)
        .map((nameAndVersion) => nameAndVersion.join(" "))
        .join(", "),
    ],
  );
  if (data.overrides.length) pairs.push(["set on the command line", data.overrides.join("  ")]);
  const optionalParts = {
    levels: "contact lines of the coarser levels",
    live: "the data of the live mode",
    body: "temperature and displacement of the body",
    lines: "all contact lines",
  };
  if (data.without.length)
    pairs.push([
      "left out of this page",
      data.without.map((key) => optionalParts[key]).join(", ") + "; the file has it",
    ]);
  host.append(TC.h3("Where it comes from"), TC.facts(pairs));
  host.append(
    TC.el(
      "details",
      { open: false },
      TC.el("summary", {}, "The study (YAML)"),
      TC.el(
        "button",
        { class: "noprint", onclick: () => TC.save("study.yaml", data.yaml, "text/yaml") },
        "download",
      ),
      TC.el("pre", {}, data.yaml),
    ),
  );
};
