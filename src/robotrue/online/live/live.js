// The live view: frames into the history as they come, one painting per frame of the screen.

import { History, TRACES } from "./history.js";
import { Range, colours, panel, strip } from "./plot.js";
import { otherLanguage, settle, speak, word } from "./words.js";

const AXES = ["x", "y", "z"];
const MOST_GROUPS = 600;
const STALE_MS = 1000;
const READ_MS = 200; // numbers that change faster cannot be read
const ACKNOWLEDGED = 10; // frames
const byId = (id) => document.getElementById(id);

const state = {
  hello: null, history: null, shown: null, last: null, cameAt: 0, links: [], dropped: 0,
  paused: false, span: 10, limits: [0, 0, 0], same: true, dirty: true, link: "waiting",
  received: 0, painted: 0, spent: 0, notBefore: 0, groups: [], token: "",
};
const ranges = [new Range(5), new Range(5), new Range(5), new Range(20), new Range(0.5)];
let colour = null;
let asked = {}; // what the page around the view asked for

// ---- the connection -------------------------------------------------------------------------

function connect(wait = 500) {
  const scheme = location.protocol === "https:" ? "wss:" : "ws:";
  const query = state.token ? `?token=${encodeURIComponent(state.token)}` : "";
  const socket = new WebSocket(`${scheme}//${location.host}${asked.path ?? "/frames"}${query}`);
  let opened = false;
  socket.onopen = () => { opened = true; wait = 500; show(asked.path ? "waiting" : "connected"); };
  let had = 0;
  socket.onmessage = (event) => {
    take(JSON.parse(event.data));
    // a relay sends no more than a second ahead of what was had: nothing waits in buffers and comes late
    if (asked.path && ++had % ACKNOWLEDGED === 0) socket.send(String(ACKNOWLEDGED));
  };
  socket.onclose = () => {
    show(opened || state.hello || asked.path ? "gone" : "refusedToken");
    if (!opened && !state.hello && !asked.path) byId("door").hidden = false;
    setTimeout(() => connect(Math.min(wait * 1.6, 5000)), wait);
  };
}

function show(link) {
  state.link = link;
  state.dirty = true;
  if (link === "connected" && !asked.path) byId("door").hidden = true;
}

function take(frame) {
  if (frame.type === "hello") {
    if (!state.history || JSON.stringify(frame) !== JSON.stringify(state.hello)) {
      state.history = new History(Math.ceil(frame.per_second * 61), frame.joints);
      state.shown = null;
      state.paused = false;
    }
    state.hello = frame;
    title();
  } else if (frame.type === "estimates") {
    for (const bin of frame.bins) state.history.push(bin);
    state.last = frame.bins[frame.bins.length - 1];
    state.cameAt = performance.now();
    state.received++;
  } else if (frame.type === "health") {
    state.links = frame.links;
    state.dropped = frame.dropped;
    links();
  } else if (frame.type === "source") show(frame.state);
  asked.onFrame?.(frame);
  state.dirty = true;
}

// ---- painting: never in the handler of a message --------------------------------------------

function paint() {
  requestAnimationFrame(paint);
  if (!state.dirty || !state.hello || performance.now() < state.notBefore) return;
  state.dirty = false;
  state.painted++;
  const begun = performance.now();
  const history = state.paused ? state.shown : state.history;
  const end = history.end;
  if (Number.isNaN(end)) return;
  const period = 1 / state.hello.per_second;
  const box = { end, span: state.span };
  const groups = history.groups(end - state.span, period, MOST_GROUPS, state.span);
  scales(groups);
  AXES.forEach((a, k) => {
    const trace = { index: k, colour: colour.axes[k], band: true };
    const text = { title: word("errorTitle", { a }), limit: state.limits[k] };
    panel(byId(`error-${a}`), groups, [trace], ranges[k], box, colour, text);
  });
  const forces = AXES.map((a, k) => ({ index: 3 + k, colour: colour.axes[k], label: `f${a}` }));
  panel(byId("force"), groups, forces, ranges[3], box, colour, { title: word("forceTitle"), limit: 0 });
  panel(byId("turns"), groups, turns(groups, history.joints), ranges[4], box, colour, { title: word("turnsTitle"), limit: 0, times: true });
  strip(byId("doubts"), groups, box, colour, reason);
  state.groups = groups;
  const spent = performance.now() - begun;
  state.spent += spent;
  // on a slow screen most of the time is left to buttons and numbers
  state.notBefore = spent > 10 ? begun + Math.min(3 * spent, 1000) : 0;
}

// A joint is drawn less its mean over the window: a pass turns it by less than a line is wide.
function turns(groups, joints) {
  let [low, high] = [Infinity, -Infinity];
  const traces = Array.from({ length: joints }, (_, j) => {
    const index = TRACES + j;
    const known = groups.filter((g) => !Number.isNaN(g.low[index]));
    const less = known.reduce((sum, g) => sum + (g.low[index] + g.high[index]) / 2, 0) / Math.max(1, known.length);
    for (const g of known) {
      low = Math.min(low, g.low[index] - less);
      high = Math.max(high, g.high[index] - less);
    }
    const dashed = j > 2;
    return { index, colour: colour.axes[j % 3], line: true, dashed, less, label: `A${j + 1}${dashed ? " ┄" : ""}` };
  });
  ranges[4].fit(low, high, performance.now());
  return traces;
}

function scales(groups) {
  const now = performance.now();
  const spans = [0, 1, 2, 3].map(() => [Infinity, -Infinity]);
  for (const g of groups) {
    for (let k = 0; k < 6; k++) {
      const span = spans[Math.min(k, 3)];
      const wide = k < 3 ? 2 * (g.sd[k] || 0) : 0;
      if (g.low[k] - wide < span[0]) span[0] = g.low[k] - wide;
      if (g.high[k] + wide > span[1]) span[1] = g.high[k] + wide;
    }
  }
  const all = [Math.min(...spans.slice(0, 3).map((s) => s[0])), Math.max(...spans.slice(0, 3).map((s) => s[1]))];
  const errors = state.same ? [all, all, all] : spans.slice(0, 3);
  errors.forEach(([low, high], k) => {
    const limit = state.same ? Math.max(...state.limits) : state.limits[k];
    ranges[k].fit(Math.min(low, -limit), Math.max(high, limit), now);
  });
  ranges[3].fit(spans[3][0], spans[3][1], now);
}

function reason(doubt, kind) {
  return kind === "none" ? [word("nothing")] : names(doubt & state.hello.invalid);
}

const names = (doubt) =>
  Object.entries(state.hello.doubts).filter(([bit]) => doubt & bit).map(([, name]) => word(name));

// ---- numbers --------------------------------------------------------------------------------

const number = (v, digits = 1) => (v === null || v === undefined ? "—" : v.toFixed(digits));

// Numbers of a stream that has stopped are taken away: they would be believed.
const NOTHING = { error_um: [], sd_um: [], static_um: [], force_N: [], moment_Nm: [], joints_deg: [] };

function values() {
  if (!state.last) return;
  const last = stopped() ? NOTHING : state.last;
  const groups = state.groups;
  AXES.forEach((a, k) => {
    const row = byId("errors").tBodies[0].rows[k];
    const peak = Math.max(...groups.map((g) => Math.max(Math.abs(g.low[k]), Math.abs(g.high[k])) || 0));
    const sd = typeof last.error_um[k] === "number" ? 2 * last.sd_um[k] : null;
    const cells = [`e${a}`, number(last.error_um[k]), number(sd), number(last.static_um[k]), number(peak)];
    cells.forEach((text, i) => put(row.cells[i], text));
    const beyond = (v) => state.limits[k] > 0 && Math.abs(v ?? 0) > state.limits[k];
    row.classList.toggle("over", beyond(peak));
    row.classList.toggle("now-over", beyond(last.error_um[k]));
  });
  AXES.forEach((a, k) => {
    const row = byId("forces").tBodies[0].rows[k];
    [`f${a}  N`, number(last.force_N[k], 0), `m${a}  Nm`, number(last.moment_Nm[k], 1)]
      .forEach((text, i) => put(row.cells[i], text));
  });
  const items = byId("joints").children;
  Array.from(items).forEach((item, k) => put(item.lastChild, number(last.joints_deg[k], 2)));
}

const stopped = () => state.link !== "connected" || performance.now() - state.cameAt > STALE_MS;

// The state is never paused: whoever looks must know whether the machine is believed now.
function verdict() {
  const node = byId("state");
  const age = performance.now() - state.cameAt;
  let [kind, head, more] = ["waiting", word("idle"), ""];
  if (state.link !== "connected" && state.link !== "waiting") [kind, head] = ["bad", word("bad")];
  else if (state.last && age > STALE_MS) [kind, head] = ["bad", word("stale", { s: Math.floor(age / 1000) })];
  else if (state.last) {
    const bad = state.last.doubt & state.hello.invalid;
    if (state.last.invalid) [kind, head, more] = ["bad", word("bad"), names(bad).join(", ")];
    else if (state.last.doubt) [kind, head, more] = ["wary", word("wary"), names(state.last.doubt).join(", ")];
    else [kind, head] = ["good", word("good")];
  }
  const text = head + more;
  if (node.dataset.text === text && node.dataset.state === kind) return;
  node.dataset.text = text;
  node.dataset.state = kind;
  const small = document.createElement("small");
  small.textContent = more;
  node.replaceChildren(head, small);
  values(); // at once: a number must not stand beside a verdict that it is none
}

function links() {
  const body = byId("links").tBodies[0];
  body.replaceChildren(...state.links.map((h) => {
    const row = document.createElement("tr");
    const answer = h.turnaround_p50_ms === null ? "—" : `${number(h.turnaround_p50_ms, 2)} / ${number(h.turnaround_p99_ms, 2)}`;
    const cells = [h.name, word(h.connected ? "yes" : "no"), h.received, h.lost, h.late, h.refused,
      h.dropped, h.reconnects, answer, h.last_fault];
    cells.forEach((value, i) => {
      const cell = row.insertCell();
      cell.textContent = typeof value === "number" ? value.toLocaleString("en") : value;
      cell.classList.toggle("warn", i === 1 ? !h.connected : i >= 3 && i <= 5 && value > 0);
    });
    return row;
  }));
}

// ---- fixed parts ----------------------------------------------------------------------------

const put = (node, text) => { if (node.textContent !== text) node.textContent = text; };

function title() {
  const { cell, note, joints } = state.hello;
  put(byId("cell"), cell);
  byId("note").hidden = !note;
  put(byId("note"), word(note));
  if (!asked.path) document.title = `${note ? `${note}: ` : ""}${cell} · robotrue`;
  const list = byId("joints");
  list.replaceChildren(...Array.from({ length: joints }, (_, k) => {
    const item = document.createElement("li");
    item.append(Object.assign(document.createElement("span"), { textContent: `A${k + 1}` }), document.createElement("b"));
    return item;
  }));
}

function texts() {
  settle();
  put(byId("pause"), word(state.paused ? "resume" : "pause"));
  put(byId("scale"), word(state.same ? "scaleSame" : "scaleEach"));
  put(byId("language"), word("language"));
  put(byId("veil"), word("paused"));
  byId("veil").hidden = !state.paused;
  for (const a of AXES) byId(`error-${a}`).setAttribute("aria-label", word("errorTitle", { a }));
  byId("force").setAttribute("aria-label", word("forceTitle"));
  byId("turns").setAttribute("aria-label", word("turnsTitle"));
  if (state.hello) title();
  links();
  state.dirty = true;
}

function pause() {
  if (!state.history) return;
  state.paused = !state.paused;
  state.shown = state.paused ? state.history.copy() : null;
  texts();
}

function rows(id, columns) {
  const body = byId(id).tBodies[0];
  for (const a of AXES) {
    const row = body.insertRow();
    for (let i = 0; i < columns; i++) row.insertCell();
    row.cells[0].className = a;
  }
}

// ---- the page it stands on -------------------------------------------------------------------

// On its own: a token, a language and one limit for all axes, kept by the browser.
function alone() {
  const query = new URLSearchParams(location.search);
  state.token = query.get("token") ?? sessionStorage.getItem("token") ?? "";
  if (query.has("token")) { // not left standing in the address bar
    sessionStorage.setItem("token", state.token);
    history.replaceState(null, "", location.pathname);
  }
  byId("language").onclick = () => { otherLanguage(); texts(); };
  const limit = () => limits(Array(3).fill(Number(byId("limit").value)));
  byId("limit").value = localStorage.getItem("limit") ?? "";
  byId("limit").oninput = (event) => {
    localStorage.setItem("limit", event.target.value);
    limit();
  };
  limit();
  byId("door").onsubmit = (event) => {
    event.preventDefault();
    state.token = byId("token").value;
    sessionStorage.setItem("token", state.token);
  };
}

// um along x, y and z; 0 is none.
export function limits(um) {
  state.limits = um.map((v) => Math.max(0, v || 0));
  state.dirty = true;
}

export function recolour() {
  colour = colours();
  state.dirty = true;
}

// Begins. `options`, where another page holds the view: { path, language, onFrame }.
export function start(options = {}) {
  asked = options;
  colour = colours();
  rows("errors", 5);
  rows("forces", 4);
  if (asked.path) speak(asked.language);
  else alone();
  byId("pause").onclick = pause;
  byId("scale").onclick = () => { state.same = !state.same; texts(); };
  byId("window").onchange = (event) => { state.span = Number(event.target.value); state.dirty = true; };
  document.addEventListener("keydown", (event) => {
    if (event.code !== "Space" || event.target.closest("input, select, button, a, summary, [tabindex]")) return;
    event.preventDefault();
    pause();
  });
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", recolour);
  new ResizeObserver(() => { state.dirty = true; }).observe(document.querySelector(".plots"));
  texts();
  connect();
  requestAnimationFrame(paint);
  let [received, painted] = [0, 0];
  setInterval(() => {
    const node = byId("counts");
    put(node, word("counts", { r: state.received - received, p: state.painted - painted, d: state.dropped }));
    [received, painted] = [state.received, state.painted];
    [node.dataset.received, node.dataset.painted] = [received, painted];
    node.dataset.paintMs = (state.spent / Math.max(1, state.painted)).toFixed(2);
  }, 1000);
  setInterval(values, READ_MS);
  setInterval(() => {
    verdict();
    put(byId("link"), word(state.link));
    byId("link").dataset.state = state.link === "connected" ? "up" : state.link === "waiting" ? "waiting" : "lost";
  }, 100);
}
