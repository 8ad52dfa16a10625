// Start: decode, restore the state from the address, draw, listen.
TC.draw = function () {
  const data = TC.data;
  if (data.sections) TC.sections(document.getElementById("main"), data.sections);
  else if (TC.state.mode === "live") TC.live.draw();
  else TC.run.draw();
  for (const button of document.querySelectorAll("#modes button"))
    button.setAttribute("aria-selected", String(button.value === TC.state.mode));
};
// Sections under their headings, and where the file comes from.
TC.sections = function (main, sections) {
  if (!TC.sections.hosts) {
    main.replaceChildren();
    TC.sections.hosts = sections.map((section) => TC.section(section.title, section.id));
    TC.provenance(TC.section("The study", "study"));
  }
  sections.forEach((section, index) => TC.show(TC.sections.hosts[index], section.parts));
};
TC.theme = (name) => (document.documentElement.dataset.theme = TC.state.theme = name);
TC.restore = function () {
  const stored = TC.readState();
  Object.keys(TC.state).forEach((key) => delete TC.state[key]);
  if (stored.theme) TC.theme(stored.theme);
  if (TC.data.run) TC.run.setup(stored);
  else Object.assign(TC.state, stored);
};
TC.start = async function () {
  const data = (TC.data = await TC.decode(document.getElementById("data").textContent));
  const verdict = document.getElementById("verdict");
  const how = data.verdict.how;
  const kinds = {
    run: "a parametric study",
    convergence: "convergence of a study",
    cost: "accuracy against cost",
    path: "equilibria along a parameter",
    history: "a load history",
    fit: "parameter identification",
  };
  document.getElementById("kind").textContent = `tcstudy: ${kinds[data.kind]}`;
  verdict.classList.toggle("bad", !data.verdict.ok);
  document.getElementById("how").textContent = how ? `${how[0].toUpperCase()}${how.slice(1)}.` : "";
  TC.restore();
  const clearPage = () => {
    TC.run.host = TC.live.host = TC.sections.hosts = null;
    document.getElementById("main").replaceChildren();
  };
  if (data.live) {
    const nav = document.getElementById("modes");
    const showMode = (mode) => () => {
      clearPage();
      TC.set({ mode });
    };
    nav.hidden = false;
    nav.append(
      TC.el("button", { value: "", role: "tab", onclick: showMode("") }, "Stored results"),
      TC.el(
        "button",
        { value: "live", role: "tab", onclick: showMode("live") },
        "Explore live: solve here, in the browser",
      ),
    );
  }
  TC.draw();
  let width = window.innerWidth;
  let timer = null;
  window.addEventListener("resize", () => {
    if (window.innerWidth !== width) {
      width = window.innerWidth;
      clearTimeout(timer);
      timer = setTimeout(TC.draw, 120);
    }
  });
  window.addEventListener("hashchange", () => {
    TC.restore();
    clearPage();
    TC.draw();
  });
  document.getElementById("theme").addEventListener("click", TC.toggle);
  document.getElementById("help").addEventListener("click", TC.showKeys);
  document.addEventListener("keydown", (event) => {
    if (
      event.ctrlKey ||
      event.metaKey ||
      event.altKey ||
      /^(INPUT|SELECT|TEXTAREA)$/.test(document.activeElement.tagName)
    )
      return;
    const state = TC.state;
    const isRunShown = data.run && state.mode !== "live";
    const action = {
      d: TC.toggle,
      "?": TC.showKeys,
      "[": () => TC.step(-1),
      "]": () => TC.step(1),
      c: () => isRunShown && !data.steps && TC.set({ vs: state.vs ? null : state.at.slice() }),
      q: () => {
        if (isRunShown) {
          const quantities = Object.keys(data.run.numbers);
          TC.set({ q: quantities[(quantities.indexOf(state.q) + 1) % quantities.length] });
        }
      },
    }[event.key];
    if (action) {
      event.preventDefault();
      action();
    }
  });
  document.documentElement.dataset.ready = "1";
};
// One level, or state (a step, a vertex of a path, a datum), on or back.
TC.step = function (change) {
  const state = TC.state;
  const moved = (value, count) => Math.max(0, Math.min(count - 1, value + change));
  if (TC.stateCount) TC.set({ step: moved(state.step, TC.stateCount) });
  else if (TC.data.run && state.mode !== "live")
    TC.set({ level: moved(state.level, TC.data.run.nlevels) });
};
TC.toggle = function () {
  const isDark = document.documentElement.dataset.theme
    ? document.documentElement.dataset.theme === "dark"
    : matchMedia("(prefers-color-scheme: dark)").matches;
  TC.theme(isDark ? "light" : "dark");
  TC.writeState();
  TC.draw();
};
TC.showKeys = () => document.getElementById("keys").showModal();
TC.start().catch((error) => {
  document.getElementById("main").textContent =
    `The page cannot be drawn: ${error}. It needs a browser of 2023 or later.`;
  console.error(error);
});
