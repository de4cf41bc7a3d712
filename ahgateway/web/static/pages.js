// The link and the log, and what all pages share.

// A day of a recording takes a while; a gateway that hangs must not be waited for for ever.
const LONGEST_MS = 120000;

export async function get(name, query = {}, patience = LONGEST_MS) {
  try {
    const reply = await fetch(`${name}.json?${new URLSearchParams(query)}`, { signal: AbortSignal.timeout(patience) });
    return reply.ok ? await reply.json() : null;
  } catch { return null; }
}

export function fill(node, text, kind) {
  const said = String(text);
  if (node.textContent !== said) node.textContent = said;
  if (kind !== undefined && node.className !== kind) node.className = kind;
}

export function cell(text, kind = "") {
  const made = document.createElement("td");
  made.textContent = text;
  made.className = kind;
  return made;
}

// As in the terminal: every word must occur, -word must not.
export function passes(wanted, line) {
  const text = line.toLowerCase();
  return wanted.toLowerCase().split(/\s+/).filter(Boolean)
    .every((word) => word.length > 1 && word[0] === "-" ? !text.includes(word.slice(1)) : text.includes(word));
}

export class LinkPage {
  async refresh() {
    const found = await get("link");
    if (!found) return;
    const card = (name, text, bad, wide) => {
      const made = document.createElement("div");
      made.className = `card${bad ? " bad" : ""}${wide ? " wide" : ""}`;
      const figure = document.createElement("b");
      figure.textContent = text;
      made.append(figure, name);
      return made;
    };
    document.getElementById("link-figures").replaceChildren(
      card(found.target, found.up ? "up" : "DOWN", !found.up, true),
      ...found.figures.map(([name, count], index) => card(name, count, index > 1 && count > 0)),
      card("first cause of trouble", found.first_cause || "none", Boolean(found.first_cause), true));
    fill(document.getElementById("round-trips"), found.mean_ms === null ? "no reply yet, or none measured"
      : `mean ${found.mean_ms.toFixed(2)} ms, worst ${found.worst_ms.toFixed(2)} ms; the latest by class`);
    const most = Math.max(1, ...found.classes.map((each) => each[2]));
    document.getElementById("histogram").replaceChildren(...found.classes.flatMap(([low, high, count]) => {
      const name = document.createElement("span"), number = document.createElement("span"), bar = document.createElement("i");
      name.textContent = high === null ? `${low} ms and more` : `${low} … < ${high} ms`;
      number.textContent = count;
      number.style.textAlign = "right";
      bar.style.width = `${100 * count / most}%`;
      return [name, number, bar];
    }));
    fill(document.getElementById("frames"), found.frames.join("\n"));
  }
}

const LINES_MAX = 2000;

export class LogPage {
  constructor() {
    this.count = 0;
    this.lines = [];
    document.getElementById("log-filter").addEventListener("input", () => this.draw());
  }

  async refresh() {
    const found = await get("log", { after: this.count });
    if (!found) return;
    if (found.cuts !== this.cuts) {
      const isFirst = this.cuts === undefined;
      this.cuts = found.cuts;
      if (!isFirst) { this.count = 0; this.lines = []; this.draw(); return this.refresh(); }
    }
    if (found.count === this.count) return;
    this.count = found.count;
    this.lines = this.lines.concat(found.lines).slice(-LINES_MAX);
    this.draw();
  }

  draw() {
    const wanted = document.getElementById("log-filter").value;
    const shown = this.lines.filter((line) => passes(wanted, line)).reverse();
    fill(document.getElementById("log-count"), `${shown.length} of ${this.lines.length} events, newest first`);
    document.getElementById("log").replaceChildren(...shown.map((line) => {
      const made = document.createElement("li");
      made.textContent = line;
      made.className = line.includes(" DIVERGED: ") ? "DIVERGED" : line.includes(" note: ") ? "note" : "";
      return made;
    }));
  }
}
