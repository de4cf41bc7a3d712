// Small trends, one for each loop: only what is in sight is drawn, four times a second (half a pixel of three minutes),
// and only a few in each frame, so that no frame is long.
import { get } from "./pages.js";

const SPAN_S = 180, DRAW_MS = 250, PER_FRAME = 4, BAND = 5;

export class Sparks {
  constructor() {
    this.loops = new Map();
    this.since = 0;
    this.shown = new Set();
    this.clock = null;
    this.drawn = 0;
    this.waiting = [];
    this.seen = new IntersectionObserver((entries) => {
      for (const entry of entries) {
        if (entry.isIntersecting) this.shown.add(entry.target.dataset.loop); else this.shown.delete(entry.target.dataset.loop);
      }
    });
    requestAnimationFrame((now) => this.frame(now));
  }

  add(name, canvas) {
    canvas.dataset.loop = name;
    this.loops.set(name, { canvas, t: [], sv: [], pv: [], mark: [] });
    this.seen.observe(canvas);
  }

  async fetch(t) {
    if (this.clock && t < this.clock.t) this.reset();
    const found = await get("recent", { since: this.since });
    if (!found) return;
    this.since = found.t;
    const before = this.clock;
    const rate = before ? (found.t - before.t) / Math.max(1, performance.now() - before.at) : 0;
    this.clock = { t: found.t, at: performance.now(), rate: Math.min(rate, 0.002) };
    for (const [name, fresh] of Object.entries(found.loops)) {
      const kept = this.loops.get(name);
      if (!kept) continue;
      for (const key of ["t", "sv", "pv", "mark"]) kept[key].push(...fresh[key]);
      let old = 0;
      while (old < kept.t.length && kept.t[old] < found.t - SPAN_S - 10) old++;
      if (old) for (const key of ["t", "sv", "pv", "mark"]) kept[key].splice(0, old);
    }
  }

  reset() {
    this.since = 0;
    this.clock = null;
    for (const kept of this.loops.values()) for (const key of ["t", "sv", "pv", "mark"]) kept[key].length = 0;
  }

  repaint() { this.colours = null; }

  frame(now) {
    if (!this.waiting.length && now - this.drawn >= DRAW_MS) {
      this.drawn = now;
      this.waiting = [...this.shown];
    }
    if (this.clock && this.waiting.length) {
      if (!this.colours) {
        const style = getComputedStyle(document.documentElement);
        const colour = (name) => style.getPropertyValue(name).trim();
        this.colours = { pv: colour("--pv"), sv: colour("--sv"), mark: [1, 2, 3, 4, 5, 6].map((each) => colour(`--mark${each}`)) };
      }
      const until = this.clock.t + (now - this.clock.at) * this.clock.rate;
      for (const name of this.waiting.splice(0, PER_FRAME)) this.draw(this.loops.get(name), until);
    }
    requestAnimationFrame((next) => this.frame(next));
  }

  draw({ canvas, t, sv, pv, mark }, until) {
    const width = canvas.clientWidth, height = canvas.clientHeight, ratio = devicePixelRatio;
    if (!width) return;
    if (canvas.width !== Math.round(width * ratio)) { canvas.width = Math.round(width * ratio); canvas.height = Math.round(height * ratio); }
    const pen = canvas.getContext("2d");
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, width, height);
    if (!t.length) return;
    const x = (moment) => width * (1 - (until - moment) / SPAN_S);
    let low = Infinity, high = -Infinity;
    for (const values of [sv, pv]) for (const value of values) if (value !== null) { low = Math.min(low, value); high = Math.max(high, value); }
    if (low === Infinity) { low = 0; high = 1; }
    const margin = Math.max((high - low) * 0.08, Math.abs(high) * 1e-4, 1e-9), room = height - BAND - 2;
    low -= margin; high += margin;
    const y = (value) => room * (high - value) / (high - low) + 1;
    for (let i = 0; i < t.length; i++) {
      if (!mark[i]) continue;
      pen.fillStyle = this.colours.mark[mark[i] - 1];
      const from = i ? x(t[i - 1]) : x(t[i]) - 1;
      // What diverged stands taller, so that it is seen without colour.
      const tall = mark[i] === 6 ? BAND + 3 : mark[i] === 1 || mark[i] === 2 ? BAND - 2 : BAND;
      pen.fillRect(from, height - tall, Math.max(1, x(t[i]) - from + 0.5), tall);
    }
    this.curve(pen, t, sv, x, y, this.colours.sv, [3, 3], true);
    this.curve(pen, t, pv, x, y, this.colours.pv, [], false);
  }

  curve(pen, t, values, x, y, colour, dash, isHeld) {
    pen.beginPath();
    pen.setLineDash(dash);
    pen.strokeStyle = colour;
    pen.lineWidth = 1.3;
    let last = null;
    for (let i = 0; i < t.length; i++) {
      if (values[i] === null) { last = null; continue; }
      if (last === null) pen.moveTo(x(t[i]), y(values[i]));
      else { if (isHeld) pen.lineTo(x(t[i]), y(last)); pen.lineTo(x(t[i]), y(values[i])); }
      last = values[i];
    }
    pen.stroke();
  }
}
