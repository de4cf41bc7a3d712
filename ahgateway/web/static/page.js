// The page: asks for facts with GET and shows them; it has nothing with which to change anything.
import { Sparks } from "./sparks.js";
import { Trend } from "./trend.js";
import { LogPage, LinkPage, fill, cell, get, passes } from "./pages.js";

const STATE_MS = 500, LOOP_MS = 1000, QUIET_AFTER_MS = 3000, PATIENCE_MS = 5000;
const by = (id) => document.getElementById(id);

const sparks = new Sparks();
const trend = new Trend(by("trend"), { reading: by("reading"), legend: by("legend"), live: by("live"), spans: by("spans") });
const pages = { link: new LinkPage(), log: new LogPage() };
let state = null, answered = performance.now(), page = "loops", chosen = "", looked = null, unknown = "", isSilent = false;
const rows = new Map();

function theme(name) {
  document.documentElement.dataset.theme = name;
  sparks.repaint();
  trend.paint();
}

// What stands behind the # may be anything that somebody typed.
function typed(hash) {
  try { return decodeURIComponent(hash); } catch { return hash; }
}

function show() {
  const [, name, loop] = /^([^=]*)=?(.*)$/s.exec(typed(location.hash.slice(1)));
  page = by(`page-${name}`) ? name : "loops";
  unknown = loop && state && !state.loops.some((each) => each.name === loop) ? loop : "";
  if (unknown) page = "loops";
  else if (loop) chosen = loop;
  for (const section of document.querySelectorAll("main > section")) section.hidden = section.id !== `page-${page}`;
  for (const link of document.querySelectorAll("nav a")) {
    if (link.dataset.page === page) link.setAttribute("aria-current", "page"); else link.removeAttribute("aria-current");
  }
  if (page === "loop" && state) openLoop();
  if (page === "loops" && state) loops();
  pages[page]?.refresh();
}

async function openLoop() {
  if (!state.loops.some((loop) => loop.name === chosen)) chosen = state.loops[0].name;
  by("choose").value = chosen;
  await trend.open(chosen, state);
  await refreshLoop();
}

function pill(node, word) {
  node.className = `pill ${word.split(" ")[0]}`;
  node.textContent = word;
}

// Asked by a clock of its own: a gateway that hangs sends no answer after which it could be asked.
function head() {
  const silent = performance.now() - answered > QUIET_AFTER_MS;
  const alarm = by("alarm");
  document.body.classList.toggle("silent", silent);
  if (silent !== isSilent) {
    isSilent = silent;
    if (silent && state) {
      for (const loop of state.loops) Object.assign(loop, { stale: true, word: "STALE" });
      loops();
    }
    if (silent && looked) { Object.assign(looked.row, { stale: true, word: "STALE" }); showLoop(looked); }
  }
  if (silent) { alarm.className = "pill alarm"; alarm.textContent = "GATEWAY SILENT: nothing shown is live"; return; }
  if (!state) return;
  by("station").textContent = state.station;
  document.title = `${state.diverged ? `${state.diverged} DIVERGED · ` : ""}${state.station}`;
  const said = [];
  if (!state.up) said.push("LINK DOWN");
  if (state.diverged) said.push(`${state.diverged} DIVERGED`);
  if (state.stale) said.push(`${state.stale} STALE`);
  alarm.className = said.length ? "pill alarm" : "pill calm";
  alarm.textContent = said.join(" · ") || "none diverged";
  const clock = new Date(state.t * 1000).toISOString().slice(0, 19).replace("T", " ");
  const player = state.player ? ` · ${state.player}` : "";
  by("facts").textContent = `${state.loops.length} loop${state.loops.length === 1 ? "" : "s"} · ${state.target} · ${clock}Z${player}`;
}

function loops() {
  const body = document.querySelector("#loops tbody");
  const wanted = by("loops-filter").value, trouble = by("loops-trouble").checked;
  let shown = 0;
  for (const loop of state.loops) {
    let row = rows.get(loop.name);
    if (!row) {
      row = document.createElement("tr");
      row.innerHTML = "<td></td><td><span class=pill></span></td><td class=right></td><td class=right></td>"
        + "<td class=spark><canvas></canvas></td><td class=right></td><td class=right></td><td class=right></td>"
        + "<td></td><td></td><td class=right></td><td></td><td class=notes></td>";
      row.cells[0].textContent = loop.name;
      row.tabIndex = 0;
      const open = () => { location.hash = `loop=${encodeURIComponent(loop.name)}`; };
      row.addEventListener("click", open);
      row.addEventListener("keydown", (event) => { if (event.key === "Enter") open(); });
      rows.set(loop.name, row);
      body.append(row);
      sparks.add(loop.name, row.querySelector("canvas"));
    }
    const text = `${loop.name} ${loop.word} ${loop.mode} ${loop.health} ${loop.notes}`;
    const hides = !passes(wanted, text) || (trouble && !loop.look && !loop.stale);
    row.hidden = hides;
    shown += !hides;
    pill(row.cells[1].firstChild, loop.word);
    fill(row.cells[2], `${Math.floor(loop.coverage * 100)} % of ${loop.total}`);
    fill(row.cells[3], loop.diverged, loop.diverged ? "right many" : "right");
    const old = loop.stale ? "right stale" : "right";
    const value = (text, unit) => (loop.stale && text !== "-" ? `(${text})` : text) + (unit && text !== "-" ? ` ${unit}` : "");
    fill(row.cells[5], value(loop.sv, loop.units[0]), old);
    fill(row.cells[6], value(loop.pv, loop.units[0]), old);
    fill(row.cells[7], value(loop.mv, loop.units[1]), old);
    fill(row.cells[8], value(loop.mode), old === "right" ? "" : "stale");
    fill(row.cells[9], loop.way);
    fill(row.cells[10], loop.age_s === null ? "-" : `${loop.age_s.toFixed(1)} s`, old);
    fill(row.cells[11], loop.health);
    fill(row.cells[12], loop.notes, "notes");
  }
  const count = shown === state.loops.length ? "" : `${shown} of ${state.loops.length} loops`;
  fill(by("loops-count"), unknown ? `this station has no loop ${unknown}` : count);
  if (by("choose").options.length !== state.loops.length) {
    by("choose").replaceChildren(...state.loops.map((loop) => new Option(loop.name)));
  }
}

async function refreshLoop() {
  if (page !== "loop" || !chosen || !state) return;
  const found = await get("loop", { loop: chosen }, PATIENCE_MS);
  if (!found || found.row.name !== chosen) return;
  looked = found;
  showLoop(found);
}

function showLoop(found) {
  const row = found.row, old = row.stale;
  pill(by("word"), row.word);
  fill(by("loop-facts"), `${row.instruction} · proven ${row.proven} of ${row.total} (${Math.floor(row.coverage * 100)} %) · `
    + `diverged ${row.diverged} · ${row.mode} · ${row.way} · ${row.age_s === null ? "no picture" : `${row.age_s.toFixed(1)} s old`}`);
  const side = (value, none) => value === null ? cell(none, "right hidden") : cell(old ? `(${value})` : value, old ? "right stale" : "right");
  by("terms").tBodies[0].replaceChildren(...found.terms.map((term) => line([
    cell(term.name), side(term.plc, row.age_s === null ? "-" : "not in memory"), side(term.ref, "-"),
    cell(term.same === null ? term.compared : `${term.same ? "=" : "≠"} ${term.compared}`, { true: "same", false: "apart" }[term.same] ?? "quiet"),
  ])));
  fill(by("reason"), [found.actuator, found.flags.join(", "), found.reason].filter(Boolean).join("; "));
  by("statement").hidden = !found.statement;
  fill(by("statement"), found.statement ?? "");
  by("health").tBodies[0].replaceChildren(...(found.health ?? [["", "too few samples yet"]]).map(([name, text]) => line([cell(name), cell(text)])));
  by("operands").tBodies[0].replaceChildren(...found.operands.map((each) => {
    const made = line([cell(each.changed ? "*" : ""), cell(each.name), cell(each.device, "quiet"),
      cell(old && each.value !== "-" ? `(${each.value})` : each.value, old ? "right stale" : "right"),
      cell(each.unit, "quiet"), cell(each.changed ?? "")]);
    if (each.changed) made.className = "changed";
    return made;
  }));
}

function line(cells) {
  const row = document.createElement("tr");
  row.append(...cells);
  return row;
}

async function tick() {
  const found = await get("state", {}, PATIENCE_MS);
  if (found) {
    const isFirst = !state;
    state = found;
    answered = performance.now();
    head();
    trend.now(state);
    loops();
    if (isFirst) show();
    if (page === "loops") await sparks.fetch(state.t);
  }
  setTimeout(tick, STATE_MS);
}

async function slow() {
  await refreshLoop();
  if (page === "loop") await trend.follow();
  await pages[page]?.refresh();
  setTimeout(slow, LOOP_MS);
}

function turn(step) {
  const names = state.loops.map((loop) => loop.name);
  location.hash = `loop=${encodeURIComponent(names[(names.indexOf(chosen) + step + names.length) % names.length])}`;
}

const dark = matchMedia("(prefers-color-scheme: dark)");
theme(localStorage.getItem("theme") ?? (dark.matches ? "dark" : "light"));
by("theme").addEventListener("click", () => {
  const next = document.documentElement.dataset.theme === "dark" ? "light" : "dark";
  localStorage.setItem("theme", next);
  theme(next);
});
addEventListener("hashchange", show);
addEventListener("keydown", (event) => {
  if (event.target.matches("input, select") || event.ctrlKey || event.metaKey || event.altKey) return;
  const go = { 1: "loops", 2: "loop", 3: "link", 4: "log" }[event.key];
  if (go) location.hash = go;
  if (page === "loop" && state && (event.key === "[" || event.key === "]")) turn(event.key === "[" ? -1 : 1);
});
by("before").addEventListener("click", () => turn(-1));
by("behind").addEventListener("click", () => turn(1));
by("choose").addEventListener("change", (event) => { location.hash = `loop=${encodeURIComponent(event.target.value)}`; });
by("loops-filter").addEventListener("input", loops);
by("loops-trouble").addEventListener("change", loops);
show();
tick();
slow();
setInterval(head, STATE_MS);
window.ahgateway = { trend, sparks, state: () => state };
