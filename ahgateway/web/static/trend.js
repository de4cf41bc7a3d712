// The trend of one loop: a Bokeh layout filled from the server, which sends no more samples than the screen can show.
import { get } from "./pages.js";

const HATCHES = [" ", ".", " ", "-", "/", "`", "x"];
const SETTLE_MS = 120, LIVE_MS = 250;

export class Trend {
  constructor(place, { reading, legend, live, spans }) {
    Object.assign(this, { place, reading, legendPlace: legend, liveButton: live, spans });
    this.span = 300;
    this.isLive = true;
    this.state = null;
    this.isOwn = false;
    this.wanted = null;
    this.isBusy = false;
    this.asked = 0;
    this.filled = null;
    live.addEventListener("click", () => this.follow(true));
    spans.addEventListener("click", (event) => {
      const span = event.target.dataset.span;
      if (span === undefined) return;
      this.span = Number(span);
      this.follow(true);
    });
    setInterval(() => { if (this.isLive && this.times && !this.place.closest("section").hidden) this.advance(); }, LIVE_MS);
  }

  now(state) { this.state = state; this.at = performance.now(); }

  async open(name, state) {
    this.now(state);
    if (name === this.name) return this.follow();
    this.name = name;
    const found = await get("chart", { loop: name });
    if (!found || name !== this.name) return;
    this.lanes = found.lanes;
    this.legend = found.legend;
    this.place.replaceChildren();
    this.times = null;
    const views = await Bokeh.embed.embed_item(found.item, this.place);
    const view = Array.isArray(views) ? views[0] : views;
    const root = view.model ?? view.roots?.[0]?.model ?? [...view][0].model;
    const models = [...root.document._all_models.values()];
    const named = (wanted) => models.find((model) => model.name === wanted);
    this.curves = named("curves");
    this.bars = named("runs");
    this.times = named("times");
    this.plots = models.filter((model) => model.type === "Figure");
    this.lines = models.filter((model) => model.type === "GlyphRenderer");
    this.times.change.connect(() => this.moved());
    this.times.properties.start.change.connect(() => this.moved());
    this.times.properties.end.change.connect(() => this.moved());
    this.paint();
    this.draw();
    await this.follow();
  }

  // The newest moment, drawn on between two answers so that the picture glides.
  newest() {
    if (!this.state?.reach) return Date.now() / 1000;
    const ahead = this.state.moves ? (performance.now() - this.at) / 1000 * this.state.moves : 0;
    return Math.max(this.state.t + Math.min(ahead, 1), this.state.reach[0] + 1);
  }

  range() {
    const until = this.newest();
    if (this.span) return [until - this.span, until];
    const [first, last] = this.state.reach ?? [until - 60, until];
    return [first, Math.max(last, first + 1)];
  }

  set(since, until) {
    this.isOwn = true;
    this.times.setv({ start: since * 1000, end: until * 1000 });
    this.isOwn = false;
  }

  advance() { this.set(...this.range()); }

  async follow(now = false) {
    if (now) this.isLive = true;
    this.mark();
    if (!this.isLive || !this.times || !this.state) return;
    this.advance();
    await this.ask();
  }

  moved() {
    if (this.isOwn) return;
    this.isLive = false;
    this.mark();
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.ask(), SETTLE_MS);
  }

  mark() {
    this.liveButton.setAttribute("aria-pressed", String(this.isLive));
    for (const button of this.spans.children) button.setAttribute("aria-pressed", String(this.isLive && Number(button.dataset.span) === this.span));
  }

  // One question at a time: while it is under way the newest one waits, older ones are dropped.
  async ask() {
    if (this.isBusy) { this.wanted = true; return; }
    this.isBusy = true;
    const slow = setTimeout(() => { this.reading.textContent = "reading the recording …"; }, 400);
    do {
      this.wanted = false;
      const name = this.name, { start, end } = this.times, edge = 0.25 * (end - start) / 1000;
      const slices = Math.max(100, Math.min(2000, Math.round(this.place.clientWidth / 1.5)));
      const found = await get("trend", { loop: name, since: start / 1000 - edge, until: end / 1000 + edge, slices });
      if (found && name === this.name) { this.fill(found); this.filled = { start, end }; }
    } while (this.wanted);
    clearTimeout(slow);
    this.reading.textContent = "";
    this.isBusy = false;
  }

  fill(found) {
    const numbers = (values) => Float64Array.from(values, (value) => value ?? NaN);
    const columns = { t: Float64Array.from(found.t, (moment) => moment * 1000) };
    for (const name of ["sv", "pv", "mv", "ref_mv"]) columns[name] = numbers(found[name]);
    found.lanes.forEach((lane, index) => { columns[`lane${index}`] = numbers(lane); });
    this.curves.data = columns;
    this.runs = found.runs;
    this.switches = this.lanes.flatMap((lane, index) => lane.switch ? pulses(columns.t, columns[`lane${index}`], lane.name) : []);
    this.shown = found;
    this.fillBars();
    this.asked++;
  }

  fillBars() {
    if (!this.bars || !this.runs) return;
    const rows = { left: [], right: [], row: [], colour: [], hatch: [], text: [] };
    const put = (left, right, row, colour, hatch, text) => {
      for (const [key, value] of Object.entries({ left, right, row, colour, hatch, text })) rows[key].push(value);
    };
    const texts = new Map(this.legend);
    for (const [from, to, mark] of this.runs) put(from * 1000, to * 1000, "verdict", this.colour(`--mark${mark}`), HATCHES[mark], texts.get(mark));
    for (const [from, to, name] of this.switches) put(from, to, name, this.colour("--on"), " ", `${name} ON`);
    this.bars.data = rows;
  }

  colour(name) { return getComputedStyle(document.documentElement).getPropertyValue(name).trim(); }

  draw() {
    this.legendPlace.replaceChildren(...this.legend.map(([mark, text]) => {
      const made = document.createElement("span");
      const hatch = { 1: "M4 6h1M11 6h1M18 6h1", 3: "M0 6h22", 4: "M2 12L10 0M12 12L20 0", 5: "M10 12L2 0M20 12L12 0", 6: "M0 12L10 0M0 0L10 12M12 12L22 0M12 0L22 12" }[mark] ?? "";
      made.innerHTML = `<svg viewBox="0 0 22 12"><rect width="22" height="12" fill="var(--mark${mark})"/><path d="${hatch}" stroke="#000" stroke-opacity=".55" stroke-width="1.3"/></svg>`;
      made.append(text);
      return made;
    }));
  }

  paint() {
    if (!this.plots) return;
    const paper = this.colour("--paper"), ink = this.colour("--ink"), quiet = this.colour("--quiet"), line = this.colour("--line");
    for (const plot of this.plots) {
      plot.setv({ background_fill_color: paper, border_fill_color: paper, outline_line_color: line });
      for (const part of [...plot.left, ...plot.below]) {
        part.setv({ axis_line_color: line, major_tick_line_color: line, minor_tick_line_color: null, axis_label_text_color: quiet,
          major_label_text_color: quiet, axis_label_text_font_style: "normal" });
      }
      for (const part of [...plot.center, ...plot.above]) {
        if (part.type === "Grid") part.setv({ grid_line_color: line, grid_line_alpha: 0.7 });
        if (part.type === "Legend") part.setv({ background_fill_color: paper, background_fill_alpha: 0.8, border_line_color: null, label_text_color: ink,
          label_text_font_size: "12px", glyph_height: 14, label_height: 14, spacing: 12 });
      }
    }
    const colours = { pv: "--pv", sv: "--sv", mv: "--mv", ref_mv: "--ref" };
    let level = 0;
    for (const drawn of this.lines) {
      if (drawn.name === "bars") continue;
      const name = colours[drawn.name] ?? ["--lane", "--mv"][level++ % 2];
      drawn.glyph.line_color = { value: this.colour(name) };
    }
    this.fillBars();
  }
}

// Spans of time in which a switch was on: from the sample that showed it to the first that does not.
function pulses(t, values, name) {
  const found = [];
  let from = null;
  for (let i = 0; i < t.length; i++) {
    if (values[i] > 0 && from === null) from = t[i];
    if (!(values[i] > 0) && from !== null) { found.push([from, t[i], name]); from = null; }
  }
  if (from !== null) found.push([from, t[t.length - 1], name]);
  return found;
}
