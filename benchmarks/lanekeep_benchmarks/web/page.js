"use strict";
// The page of a benchmark run. Whatever comes from files is written as text (textContent), never as HTML.
const $ = id => document.getElementById(id);
const COLOURS = ["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#8C6D1F", "#7A5FD0"];
const PART = "part:", MOST_ROWS = 300;
const state = { scenario: PART, metric: "", filter: "", sort: null, down: false, shown: null, signals: null };
let data, scenarios, placed, drawn = null, playing = 0;

function make(tag, text, properties = {}) {
  const element = Object.assign(document.createElement(tag), properties);
  if (text !== undefined) element.textContent = text;
  return element;
}
// What Plotly draws may hold tags of its own: names have none.
const plain = text => String(text).replace(/&/g, "&amp;").replace(/</g, "&lt;");
const quoted = text => /^[\w@%+=:,.\/-]+$/.test(text) ? text : `'${text.replaceAll("'", `'"'"'`)}'`;
// Places of rows in the first part of the run that has them: those that are shown together differ.
function places() {
  const found = Object.create(null);
  for (const one of scenarios) one.policies.forEach((row, i) => [row.policy, ...data.rows[row.policy]].forEach(name => found[name] ??= i));
  return found;
}
const place = name => placed[name] ?? 0;
// The page lies in the folder of its run.
const folder = () => location.protocol === "file:" ? decodeURIComponent(location.pathname).replace(/\/[^\/]*$/, "") : "FOLDER";
const colour = name => COLOURS[place(name) % COLOURS.length];
const round = name => Math.floor(place(name) / COLOURS.length) % 3; // of the colours: other lines and markers
const dash = name => ["solid", "dash", "dot"][round(name)];
const labelled = key => key === "failure_rate" ? "failure rate [%]" : data.metrics[key].label + (data.metrics[key].unit ? ` [${data.metrics[key].unit}]` : "");
const digits = key => key === "failure_rate" ? 1 : data.metrics[key].digits;
const scale = key => key === "failure_rate" ? 100 : 1;
const interval = (row, key) => key === "failure_rate" ? row.failure_rate : row.metrics[key];
const wanted = name => name.toLowerCase().includes(state.filter.toLowerCase());
const partly = () => state.scenario.startsWith(PART);
const current = () => scenarios.filter(one => partly() ? data.summary.parts[state.scenario.slice(PART.length)].includes(one.scenario) : one.scenario === state.scenario);
const unpacked = ([step, ...differences]) => { let sum = 0; return differences.map(d => d === null ? null : (sum += d) * step); };

async function unpack() {
  const bytes = Uint8Array.from(atob($("data").textContent), c => c.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  return JSON.parse(await new Response(stream).text());
}

function fill(select, pairs, chosen) {
  select.replaceChildren(...pairs.map(([value, text]) => make("option", text, { value, selected: value === chosen })));
}

function metricsHere() {
  const keys = current().map(one => Object.keys(one.policies[0].metrics));
  const common = keys[0].filter(key => keys.every(of => of.includes(key)));
  return partly() ? [...common.filter(key => key === "return"), ...common.filter(key => key !== "return"), "failure_rate"] : [...common, "failure_rate"];
}

function heading(texts, table, onSort) {
  const row = make("tr");
  texts.forEach((text, column) => {
    const cell = make("th", undefined, { scope: "col" });
    const button = make("button", text, { type: "button" });
    if (state.sort === column && table.id === "board") cell.setAttribute("aria-sort", state.down ? "descending" : "ascending");
    button.addEventListener("click", () => onSort(column));
    cell.append(onSort ? button : text);
    row.append(cell);
  });
  const head = make("thead");
  head.append(row);
  return head;
}

function cellOf(row, key) {
  const { value, low, high } = interval(row, key), d = digits(key), k = scale(key);
  const verdict = row.verdict ? row.verdict[key] : "tie";
  const cell = make("td", (k * value).toFixed(d) + ({ better: " ▲", worse: " ▼" }[verdict] || ""), { className: verdict });
  if (low !== null) cell.append(make("small", `${(k * low).toFixed(d)}…${(k * high).toFixed(d)}`));
  return [k * value, cell];
}

function board() {
  const here = current(), many = here.length > 1, keys = many ? [] : ["failure_rate", ...Object.keys(here[0].policies[0].metrics)];
  const names = here[0].policies.map(row => row.policy).filter(wanted);
  const rows = names.map(name => {
    const of = here.map(one => one.policies.find(row => row.policy === name));
    const cells = many ? of.map(row => {
      const [value, cell] = cellOf(row, state.metric);
      if (row.failures && state.metric !== "failure_rate") cell.append(make("small", `${(100 * row.failure_rate.value).toFixed(1)} % failed`, { className: "failed" }));
      return [value, cell];
    }) : keys.map(key => cellOf(of[0], key));
    return { name, cells };
  });
  if (state.sort !== null) {
    const value = row => state.sort === 0 ? row.name : row.cells[state.sort - 1][0];
    rows.sort((a, b) => (value(a) < value(b) ? -1 : value(a) > value(b) ? 1 : 0) * (state.down ? -1 : 1));
  }
  const sortBy = column => {
    state.down = state.sort === column ? !state.down : false;
    state.sort = column;
    board();
    $("board").querySelectorAll("thead button")[column].focus();
  };
  const body = make("tbody");
  for (const { name, cells } of rows) {
    const line = make("tr");
    line.append(make("th", name, { scope: "row" }), ...cells.map(([, cell]) => cell));
    body.append(line);
  }
  $("board").replaceChildren(heading(["policy", ...(many ? here.map(one => one.scenario) : keys.map(labelled))], $("board"), sortBy), body);
  $("board-title").textContent = many ? `Leaderboard: ${labelled(state.metric)}` : `Leaderboard: ${here[0].title}`;
}

function layout(more) {
  const css = getComputedStyle(document.documentElement), of = name => css.getPropertyValue(name).trim();
  const axis = { gridcolor: of("--line"), zerolinecolor: of("--line"), linecolor: of("--line"), automargin: true };
  const { xaxis, yaxis, ...rest } = more;
  return {
    paper_bgcolor: of("--paper"), plot_bgcolor: of("--paper"), font: { color: of("--ink"), size: 12 },
    margin: { l: 50, r: 10, t: 30, b: 45 }, legend: { orientation: "h", y: -0.2 }, dragmode: innerWidth < 640 ? false : "zoom",
    xaxis: { ...axis, ...xaxis }, yaxis: { ...axis, ...yaxis }, ...rest,
  };
}
// The height is the element's, too: a plot that follows the window's width asks for it.
function plot(id, traces, { height, ...rest }) {
  $(id).style.height = `${height}px`;
  return Plotly.react($(id), traces, { ...rest, autosize: true }, { responsive: true, displaylogo: false, displayModeBar: false });
}

function means() {
  const here = current(), key = state.metric, k = scale(key);
  const names = here[0].policies.map(row => row.policy).filter(wanted);
  const bars = rows => {
    const of = rows.map(row => interval(row, key));
    return {
      value: of.map(one => k * one.value), type: "data", symmetric: false,
      array: of.map(one => one.high === null ? 0 : k * (one.high - one.value)), arrayminus: of.map(one => one.low === null ? 0 : k * (one.value - one.low)),
    };
  };
  const traces = names.map(name => {
    const { value, ...error } = bars(here.map(one => one.policies.find(row => row.policy === name)));
    const single = here.length === 1, where = single ? [plain(name)] : here.map(one => plain(one.scenario));
    return { name: plain(name), mode: "markers", type: "scatter", marker: { color: colour(name), size: 9, symbol: ["circle", "diamond-open", "x"][round(name)] }, x: value, y: where, error_x: error, showlegend: !single };
  });
  const count = here.length === 1 ? names.length : here.length;
  plot("means", traces, layout({
    height: 110 + 26 * count + (here.length > 1 ? 20 * names.length : 0), title: { text: plain(labelled(key)), font: { size: 14 } },
    yaxis: { type: "category", autorange: "reversed" }, ...(here.length > 1 ? { scattermode: "group" } : {}),
  }));
}

// Which share of episodes had at most so much; failed ones never.
function profile() {
  const here = current(), key = state.metric === "failure_rate" ? null : state.metric;
  $("profile").hidden = !key || here.length > 1;
  if ($("profile").hidden) return Plotly.purge($("profile"));
  const sign = data.metrics[key].more ? -1 : 1, of = data.lines[here[0].scenario];
  const traces = here[0].policies.map(row => row.policy).filter(wanted).map(label => {
    const row = data.rows[label];
    const values = row.flatMap(name => of[name].metrics[key].filter((_, i) => !of[name].failed[i])).sort((a, b) => sign * (a - b));
    const all = row.reduce((sum, name) => sum + of[name].failed.length, 0);
    return { name: plain(label), mode: "lines", line: { shape: "hv", color: colour(label), dash: dash(label) }, x: [values[0], ...values], y: [0, ...values.map((_, i) => 100 * (i + 1) / all)] };
  });
  plot("profile", traces, layout({
    height: 380 + 12 * traces.length, title: { text: "Performance profile", font: { size: 14 } }, xaxis: { title: { text: plain(labelled(key)) }, autorange: sign < 0 ? "reversed" : true },
    yaxis: { title: { text: `episodes with at ${sign < 0 ? "least" : "most"} so much [%]` }, range: [0, 102] },
  }));
}

function episodes() {
  const rows = [];
  for (const { scenario } of current()) for (const [policy, of] of Object.entries(data.lines[scenario])) {
    if (!wanted(policy)) continue;
    const key = state.metric === "failure_rate" ? Object.keys(of.metrics)[0] : state.metric, sign = data.metrics[key].more ? 1 : -1;
    const drives = data.drives[scenario].of[policy] || {};
    of.episode.forEach((episode, i) => rows.push({ scenario, policy, episode, key, failed: of.failed[i], there: episode in drives, steps: of.steps[i], value: of.metrics[key][i], bad: sign * of.metrics[key][i] }));
  }
  rows.sort((a, b) => b.failed - a.failed || b.failed * (b.there - a.there) || a.bad - b.bad);
  const body = make("tbody");
  for (const row of rows.slice(0, MOST_ROWS)) {
    const line = make("tr"), button = make("button", row.there ? "Show" : "How to", { type: "button", ariaLabel: `Show ${row.scenario}, ${row.policy}, episode ${row.episode}` });
    button.addEventListener("click", () => show(row, true));
    const cell = make("td");
    cell.append(button);
    line.append(make("th", row.policy, { scope: "row" }), cell, make("td", row.failed ? "failed" : "", { className: row.failed ? "failed" : "" }),
      make("td", row.value.toFixed(digits(row.key))), make("td", row.episode), make("td", row.steps), make("td", row.scenario, { className: "text" }));
    body.append(line);
  }
  $("episodes").replaceChildren(heading(["policy", "course", "", state.metric === "failure_rate" ? "first metric" : labelled(state.metric), "episode", "steps", "scenario"], $("episodes")), body);
  const failed = rows.filter(row => row.failed).length;
  $("count").textContent = `${failed} of ${rows.length} episodes failed${failed ? "; they come first, those with a course to show before the others" : ""}. The others: the worst first.` + (rows.length > MOST_ROWS ? ` The first ${MOST_ROWS} are listed: choose a scenario or policies to see others.` : "");
}

function checks(field, names, chosen, onChange, swatch) {
  field.replaceChildren(field.firstElementChild, ...names.map(name => {
    const label = make("label"), box = make("input", undefined, { type: "checkbox", checked: chosen.has(name) });
    box.addEventListener("change", () => { box.checked ? chosen.add(name) : chosen.delete(name); onChange(); });
    label.append(box);
    if (swatch) { const dot = make("span", undefined, { className: "swatch" }); dot.style.background = colour(name); label.append(dot); }
    label.append(swatch ? name : data.signals[name][0]);
    return label;
  }));
}

function show(row, jump) {
  stop();
  const drives = data.drives[row.scenario], of = Object.entries(drives.of).filter(([, there]) => there[row.episode]);
  state.shown = row;
  location.replace("#" + new URLSearchParams({ scenario: row.scenario, policy: row.policy, episode: row.episode }));
  $("drive").hidden = false;
  $("drive-title").textContent = `${row.policy} on ${row.scenario}, episode ${row.episode}${row.failed ? ": failed" : ""}`;
  $("command").textContent = `lanekeep play --run ${quoted(folder())} --scenario ${quoted(row.scenario)} --policy ${quoted(row.policy)} --episode ${row.episode}`;
  const there = drives.of[row.policy]?.[row.episode] !== undefined;
  for (const id of ["overlaid", "signals", "map", "traces"]) $(id).hidden = !there;
  document.querySelector(".replay").hidden = !there;
  if (there) {
    const courses = of.map(([policy, all]) => ({ policy, ...decoded(all[row.episode], drives.control_step) }));
    const main = courses.find(one => one.policy === row.policy);
    drawn = { courses, main, grounds: (drives.grounds[main.ground] || []).map(line => line.map(unpacked)), end: Math.max(...courses.map(one => one.time.at(-1))) };
    if (state.signalsOf !== row.scenario) state.signals = new Set(Object.keys(main.signals).slice(0, 4));
    state.signalsOf = row.scenario;
    drawn.named = new Set(courses.filter((one, i) => courses.length <= 6 || one === main || i === 0).map(one => one.policy));
    checks($("overlaid"), courses.map(one => one.policy), drawn.named, draw, true);
    checks($("signals"), Object.keys(main.signals), state.signals, draw, false);
    $("time").max = drawn.end;
    $("time").value = row.failed ? main.time.at(-1) : 0;
    $("follow").checked = false;
    draw();
  }
  if (jump) { $("drive").scrollIntoView(); $("drive").focus({ preventScroll: true }); }
}

function decoded(course, step) {
  const { steps, stride, ground, signals, ...places } = course;
  const count = Object.values(signals)[0].length - 1;
  const time = Array.from({ length: count }, (_, i) => step * (Math.min(i * stride, steps - 1) + 1));
  const open = object => Object.fromEntries(Object.entries(object).map(([key, values]) => [key, unpacked(values)]));
  return { ground, time, ...open(places), signals: open(signals) };
}

// What is drawn of a course at a time: linear between its points, the last one after its end.
function at(course, values, time) {
  if (!values) return null;
  let i = course.time.findIndex(t => t >= time);
  if (i < 0) i = course.time.length - 1;
  if (i === 0 || values[i] === null || values[i - 1] === null) return values[i];
  const share = (time - course.time[i - 1]) / (course.time[i] - course.time[i - 1]);
  return values[i - 1] + Math.min(share, 1) * (values[i] - values[i - 1]);
}

function draw() {
  const css = getComputedStyle(document.documentElement), faint = css.getPropertyValue("--faint").trim();
  const courses = drawn.courses.filter(one => drawn.named.has(one.policy));
  const courseLine = one => ({ color: colour(one.policy), dash: dash(one.policy), width: one === drawn.main ? 3 : 1.5 });
  $("map").hidden = !drawn.main.x;
  if (drawn.main.x) {
    const walls = drawn.grounds.map(([x, y]) => ({ x, y, mode: "lines", line: { color: faint, width: 1 }, hoverinfo: "skip", showlegend: false }));
    const lines = courses.map(one => ({ x: one.x, y: one.y, name: plain(one.policy), mode: "lines", line: courseLine(one), showlegend: false }));
    const lead = { x: [], y: [], mode: "markers", marker: { symbol: "square", color: faint, size: 11 }, hoverinfo: "skip", showlegend: false };
    const cars = { x: [], y: [], mode: "markers", hoverinfo: "skip", showlegend: false, marker: { size: 12, color: courses.map(one => colour(one.policy)), line: { width: 1.5, color: css.getPropertyValue("--ink").trim() } } };
    drawn.moving = [walls.length + lines.length, walls.length + lines.length + 1];
    drawn.whole = around(courses);
    plot("map", [...walls, ...lines, lead, cars], layout({ height: Math.min(460, innerWidth), xaxis: { title: { text: "x [m]" }, range: drawn.whole[0] }, yaxis: { title: { text: "y [m]" }, scaleanchor: "x", range: drawn.whole[1] }, uirevision: "map" + JSON.stringify(state.shown) }));
  }
  const keys = Object.keys(drawn.main.signals).filter(key => state.signals.has(key));
  const gap = 0.08, height = keys.length ? (1 - gap * (keys.length - 1)) / keys.length : 1, axes = {};
  const traces = keys.flatMap((key, row) => {
    const top = 1 - row * (height + gap), [label, unit] = data.signals[key], name = row ? row + 1 : "";
    axes[`yaxis${name}`] = { ...layout({}).yaxis, domain: [Math.max(top - height, 0), top], title: { text: plain(label + (unit ? ` [${unit}]` : "")).replace(/ (?=\S*(?: \[|$))/, "<br>"), font: { size: 11 } } };
    return courses.map(one => ({ x: one.time, y: one.signals[key], yaxis: `y${name}`, name: plain(one.policy), mode: "lines", line: courseLine(one), showlegend: false }));
  });
  $("traces").hidden = !keys.length;
  if (keys.length) plot("traces", traces, { ...layout({ height: 60 + 150 * keys.length, xaxis: { title: { text: "time [s]" }, anchor: `y${keys.length > 1 ? keys.length : ""}` } }), ...axes });
  moment();
}

function around(courses) {
  const range = values => { const known = values.filter(v => v !== null), low = Math.min(...known), high = Math.max(...known), more = 0.05 * (high - low) + 1; return [low - more, high + more]; };
  return [range(courses.flatMap(one => one.x)), range(courses.flatMap(one => one.y))];
}

function moment() {
  const time = Number($("time").value), courses = drawn.courses.filter(one => drawn.named.has(one.policy));
  $("clock").textContent = `${time.toFixed(1)} s`;
  if (drawn.main.x) {
    const place = key => courses.map(one => at(one, one[key], time));
    const lead = key => drawn.main[key] ? [at(drawn.main, drawn.main[key], time)] : [];
    const [x, y] = [at(drawn.main, drawn.main.x, time), at(drawn.main, drawn.main.y, time)];
    const half = Math.max(4, 0.04 * Math.max(...drawn.whole.map(([low, high]) => high - low)));
    const near = $("follow").checked ? { "xaxis.range": [x - half, x + half], "yaxis.range": [y - half, y + half] } : {};
    Plotly.update($("map"), { x: [lead("lead_x"), place("x")], y: [lead("lead_y"), place("y")] }, near, drawn.moving);
  }
  if (!$("traces").hidden) Plotly.relayout($("traces"), { shapes: [{ type: "line", x0: time, x1: time, yref: "paper", y0: 0, y1: 1, line: { width: 1, dash: "dot", color: "gray" } }] });
}

function stop() { cancelAnimationFrame(playing); playing = 0; $("play").textContent = "Play"; }
function play() {
  if (playing) return stop();
  $("play").textContent = "Pause";
  if (Number($("time").value) >= drawn.end) $("time").value = 0;
  let before = performance.now();
  const step = now => {
    if (now - before > 60) {
      $("time").value = Number($("time").value) + (now - before) / 1000 * Number($("pace").value);
      before = now;
      moment();
    }
    if (Number($("time").value) >= drawn.end) return stop();
    playing = requestAnimationFrame(step);
  };
  playing = requestAnimationFrame(step);
}

function everything() {
  const keys = metricsHere();
  if (!keys.includes(state.metric)) state.metric = keys[0];
  fill($("metric"), keys.map(key => [key, labelled(key)]), state.metric);
  board(); means(); profile(); episodes();
}

async function start() {
  data = await unpack();
  scenarios = data.summary.scenarios;
  placed = places();
  const choices = Object.entries(data.summary.parts).flatMap(([part, names]) =>
    [...(names.length > 1 ? [[PART + part, part ? `${part}: all` : "all"]] : []), ...names.map(name => [name, name])]);
  state.scenario = choices[0][0];
  fill($("scenario"), choices, state.scenario);
  $("about").textContent = `${scenarios.length} scenario${scenarios.length > 1 ? "s" : ""}, ${Object.keys(data.rows).length} policies, ${data.summary.episodes} episodes each`;
  $("caption").textContent = data.caption;
  $("scenario").addEventListener("change", event => { state.scenario = event.target.value; state.sort = null; state.metric = ""; everything(); });
  $("metric").addEventListener("change", event => { state.metric = event.target.value; everything(); });
  $("filter").addEventListener("input", event => { state.filter = event.target.value; everything(); });
  $("controls").addEventListener("submit", event => event.preventDefault());
  const dark = matchMedia("(prefers-color-scheme: dark)"), again = () => { everything(); if (drawn) draw(); };
  $("theme").addEventListener("click", () => {
    const root = document.documentElement, now = root.dataset.theme || (dark.matches ? "dark" : "light");
    root.dataset.theme = now === "dark" ? "light" : "dark";
    again();
  });
  dark.addEventListener("change", again);
  $("time").addEventListener("input", moment);
  $("follow").addEventListener("change", () => { if (!$("follow").checked) Plotly.relayout($("map"), { "xaxis.range": drawn.whole[0], "yaxis.range": drawn.whole[1] }); moment(); });
  $("play").addEventListener("click", play);
  document.querySelector("main").hidden = false;
  $("wait").remove();
  everything();
  const asked = new URLSearchParams(location.hash.slice(1)), of = data.lines[asked.get("scenario")]?.[asked.get("policy")];
  const place = of ? of.episode.indexOf(Number(asked.get("episode"))) : -1;
  if (place >= 0) show({ scenario: asked.get("scenario"), policy: asked.get("policy"), episode: of.episode[place], failed: of.failed[place] }, true);
}
start().catch(error => { if ($("wait")) $("wait").textContent = `This page cannot be shown: ${error.message}`; throw error; });
