#include "app/report/image_page_assets.h"

namespace octrad::report {

const char* const kViewerStyle = R"css(:root { color-scheme: light; }
body { margin: 1.5rem auto; max-width: 100rem; padding: 0 1.5rem; background: #fff; color: #1a1a1a;
  font: 15px/1.45 system-ui, "Segoe UI", "DejaVu Sans", sans-serif; }
h1 { font-size: 1.5rem; font-weight: 600; margin: 0 0 .3rem; }
h2 { font-size: 1.15rem; font-weight: 600; margin: 2rem 0 .5rem; }
.scroll { overflow-x: auto; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; margin: .8rem 0; }
th, td { padding: .25rem .7rem; text-align: right; white-space: nowrap; }
th:first-child, td:first-child { text-align: left; padding-left: 0; }
thead th { border-bottom: 1.5px solid #1a1a1a; font-weight: 600; }
tbody td { border-bottom: 1px solid #ddd; }
td.best { font-weight: 700; }
code, kbd { font-family: ui-monospace, "DejaVu Sans Mono", monospace; font-size: .92em; }
kbd { border: 1px solid #bbb; border-bottom-width: 2px; border-radius: 3px; padding: 0 .3em; background: #f7f7f7; }
.octrad-viewer { margin: 1rem 0 2rem; }
.octrad-bar { display: flex; flex-wrap: wrap; gap: .4rem 1.1rem; align-items: center; margin: 0 0 .5rem; }
.octrad-bar .group { display: inline-flex; flex-wrap: wrap; gap: .25rem; align-items: center; }
.octrad-bar button { font: inherit; padding: .15rem .6rem; border: 1px solid #aaa; border-radius: 4px; background: #f7f7f7;
  color: inherit; cursor: pointer; }
.octrad-bar button:hover { background: #ececec; }
.octrad-bar button[aria-pressed="true"] { background: #1f4e79; border-color: #1f4e79; color: #fff; }
.octrad-bar button:focus-visible, .octrad-bar input:focus-visible { outline: 2px solid #d9822b; outline-offset: 1px; }
.octrad-bar input[type="range"] { width: 11rem; vertical-align: middle; }
.octrad-bar input[type="number"] { font: inherit; width: 5rem; }
.octrad-bar output { display: inline-block; min-width: 4.2em; font-variant-numeric: tabular-nums; }
.octrad-bar .octrad-readout { white-space: pre; }
.octrad-stage { display: grid; gap: .5rem; grid-template-columns: 1fr; }
.octrad-stage.all { grid-template-columns: repeat(auto-fit, minmax(min(24rem, 100%), 1fr)); }
.octrad-cell[hidden] { display: none; }
.octrad-cell canvas { display: block; width: 100%; max-height: 74vh; background: #777; cursor: crosshair; touch-action: none; }
.octrad-cell p { margin: .2rem 0 0; }
.octrad-cell .caption { color: #555; }
.octrad-values { font-size: .93em; }
.octrad-viewer figcaption { color: #444; font-size: .93em; }
@media print {
  @page { margin: 1.2cm; }
  body { margin: 0; max-width: none; padding: 0; font-size: 9.5pt; }
  .octrad-bar, .octrad-values, .octrad-viewer figcaption { display: none; }
  .octrad-stage, .octrad-stage.all { display: block; orphans: 1; widows: 1; }
  .scroll { overflow: visible; }
  .octrad-cell { display: inline-block; width: 48%; margin: 0 1% .4cm 0; vertical-align: top; break-inside: avoid; }
  .octrad-cell canvas { max-height: none; background: none; print-color-adjust: exact; -webkit-print-color-adjust: exact; }
  table { break-inside: avoid; font-size: 8.5pt; }
  th, td { padding: .2rem .45rem; }
}
)css";

// One class: its state, what it draws from the state, and what changes the state. A picture is stored as half floats,
// so that a table of 65536 entries tone-maps it. The figure's attribute data-state has the state, for tests.
const char* const kViewerScript = R"js("use strict";
(() => {
  const toFloat = new Float32Array(65536);
  for (let h = 0; h < 65536; ++h) {
    const exponent = h >> 10 & 31, fraction = h & 1023, sign = h & 32768 ? -1 : 1;
    toFloat[h] = sign * (exponent === 0 ? fraction * 2 ** -24
      : exponent === 31 ? (fraction ? NaN : Infinity) : (1 + fraction / 1024) * 2 ** (exponent - 15));
  }
  const encode = v => v <= 0.0031308 ? 12.92 * v : 1.055 * v ** (1 / 2.4) - 0.055;
  const clamp = (v, low, high) => Math.min(Math.max(v, low), high);
  const format = v => Number.isFinite(v) ? (v !== 0 && Math.abs(v) < 1e-3 ? v.toExponential(2) : v.toPrecision(4)) : String(v);
  const element = (name, attributes = {}, ...children) => {
    const made = document.createElement(name);
    for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
    made.append(...children);
    return made;
  };

  class Viewer {
    constructor(figure) {
      this.figure = figure;
      this.width = +figure.dataset.width;
      this.height = +figure.dataset.height;
      this.reference = figure.dataset.reference === "1";
      this.pictures = [...figure.querySelectorAll("script[data-name]")].map(source => ({
        source, name: source.dataset.name, caption: source.dataset.caption, half: null, drawn: "",
        pixels: document.createElement("canvas") }));
      this.state = { image: Math.min(this.reference ? 1 : 0, this.pictures.length - 1), mode: "color", exposure: 0,
        most: 0.5, all: false, zoom: 1, x: this.width / 2, y: this.height / 2, probe: null };
      this.before = 0;  // the picture shown before, which the space bar brings back
      this.table = { key: null, bytes: new Uint8Array(65536) };
      this.ready = false;
      this.build();
    }

    build() {
      const button = (label, title, action) => {
        const made = element("button", { type: "button", title }, label);
        made.addEventListener("click", action);
        return made;
      };
      const group = (...children) => element("span", { class: "group" }, ...children);
      this.buttons = this.pictures.map((p, i) =>
        button(`${i + 1} ${p.name}`, `key ${i + 1}`, () => this.show(i)));
      this.modes = { color: button("colour", "key c", () => this.set({ mode: "color" })) };
      if (this.reference && this.pictures.length > 1) {
        this.modes.error = button("relative error", "key e: mean of |I - R| / (R + 0.01)", () => this.set({ mode: "error" }));
        this.modes.signed = button("signed error", "key s: red too bright, blue too dark", () => this.set({ mode: "signed" }));
      }
      this.slider = element("input", { type: "range", min: -10, max: 10, step: 0.25, "aria-label": "exposure" });
      this.slider.addEventListener("input", () => this.set({ exposure: +this.slider.value }));
      this.stops = element("output");
      this.most = element("input", { type: "number", min: 0.001, max: 1000, step: 0.05, "aria-label": "largest error shown" });
      this.most.addEventListener("change", () => +this.most.value > 0 && this.set({ most: +this.most.value }));
      this.allButton = button("all", "key g: all pictures beside each other", () => this.set({ all: !this.state.all }));
      const bar = element("div", { class: "octrad-bar" }, group(...this.buttons), group(...Object.values(this.modes)),
        group("exposure ", this.slider, this.stops));
      if (this.modes.error) bar.append(group("largest error ", this.most));
      bar.append(group(this.allButton, button("fit", "key 0: the whole picture", () => this.fit()),
        button("1:1", "key p: one pixel of the picture is one of the screen", () => this.actual())));
      this.readout = element("output", { class: "octrad-readout" });
      bar.append(this.readout);
      this.stage = element("div", { class: "octrad-stage" });
      for (const [i, picture] of this.pictures.entries()) {
        picture.canvas = element("canvas", { role: "img", "aria-label": picture.name });
        picture.canvas.style.aspectRatio = `${this.width} / ${this.height}`;
        picture.cell = element("div", { class: "octrad-cell" }, picture.canvas,
          element("p", {}, element("strong", {}, `${i + 1} ${picture.name}`)));
        if (picture.caption) picture.cell.append(element("p", { class: "caption" }, picture.caption));
        this.stage.append(picture.cell);
        this.listen(picture);
      }
      this.place = element("th", {}, "pixel");
      const head = element("tr", {}, this.place, ...["R", "G", "B"].map(c => element("th", {}, c)));
      if (this.modes.error) head.append(element("th", {}, "relative error"), element("th", {}, "signed error"));
      const body = element("tbody");
      for (const picture of this.pictures) {
        picture.values = head.children.length > 4 ? 5 : 3;
        picture.row = element("tr", {}, element("td", {}, picture.name));
        for (let k = 0; k < picture.values; ++k) picture.row.append(element("td"));
        body.append(picture.row);
      }
      const caption = element("figcaption");
      caption.innerHTML = "<kbd>1</kbd> … <kbd>9</kbd> pictures, <kbd>←</kbd> <kbd>→</kbd> next, <kbd>space</kbd> the one " +
        "before; <kbd>c</kbd> <kbd>e</kbd> <kbd>s</kbd> colour and errors, <kbd>[</kbd> <kbd>]</kbd> exposure, " +
        "<kbd>g</kbd> all; wheel zooms, drag pans, <kbd>0</kbd> fits, <kbd>p</kbd> 1:1. Values are linear.";
      this.figure.append(bar, this.stage,
        element("div", { class: "scroll" }, element("table", { class: "octrad-values" }, element("thead", {}, head), body)), caption);
      this.figure.addEventListener("pointerenter", () => { active = this; });
      new ResizeObserver(() => this.ready && this.draw()).observe(this.stage);
    }

    listen(picture) {
      const canvas = picture.canvas;
      let held = null;
      canvas.addEventListener("wheel", event => {
        event.preventDefault();
        this.zoomAt(picture, event, 2 ** (-clamp(event.deltaY, -200, 200) / 200));
      }, { passive: false });
      canvas.addEventListener("pointerdown", event => {
        held = { x: event.clientX, y: event.clientY };
        canvas.setPointerCapture(event.pointerId);
      });
      canvas.addEventListener("pointermove", event => {
        if (held) {
          const scale = this.scale(canvas);
          this.set({ x: this.state.x - (event.clientX - held.x) / scale, y: this.state.y - (event.clientY - held.y) / scale });
          held = { x: event.clientX, y: event.clientY };
        } else {
          const at = this.at(canvas, event);
          this.probe(Math.floor(at.x), Math.floor(at.y));
        }
      });
      for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, () => { held = null; });
      canvas.addEventListener("dblclick", () => this.fit());
    }

    // CSS pixels for a pixel of the picture. Zoom 1 fits the picture, so that canvases of all sizes show the same part.
    scale(canvas) { return this.state.zoom * Math.min(canvas.clientWidth / this.width, canvas.clientHeight / this.height); }

    at(canvas, event) {
      const box = canvas.getBoundingClientRect(), scale = this.scale(canvas);
      return { x: this.state.x + (event.clientX - box.left - box.width / 2) / scale,
        y: this.state.y + (event.clientY - box.top - box.height / 2) / scale };
    }

    zoomAt(picture, event, factor) {
      const at = event ? this.at(picture.canvas, event) : { x: this.state.x, y: this.state.y };
      const zoom = clamp(this.state.zoom * factor, 0.25, 4 * Math.max(this.width, this.height)), f = this.state.zoom / zoom;
      this.set({ zoom, x: at.x + (this.state.x - at.x) * f, y: at.y + (this.state.y - at.y) * f });
    }

    fit() { this.set({ zoom: 1, x: this.width / 2, y: this.height / 2 }); }
    actual() { this.set({ zoom: this.state.zoom / this.scale(this.shown()[0].canvas) / devicePixelRatio }); }
    shown() { return this.state.all ? this.pictures : [this.pictures[this.state.image]]; }

    show(image) {
      if (image < 0 || image >= this.pictures.length || image === this.state.image) return;
      this.before = this.state.image;
      this.set({ image });
    }

    set(change) {
      Object.assign(this.state, change);
      this.state.x = clamp(this.state.x, 0, this.width);
      this.state.y = clamp(this.state.y, 0, this.height);
      this.draw();
    }

    half(picture) {
      if (!picture.half) {
        const raw = atob(picture.source.textContent), bytes = new Uint8Array(raw.length);
        for (let i = 0; i < raw.length; ++i) bytes[i] = raw.charCodeAt(i);
        picture.half = new Uint16Array(bytes.buffer);
        picture.source.textContent = "";
      }
      return picture.half;
    }

    errors(picture, p) {
      const value = this.half(picture), truth = this.half(this.pictures[0]);
      let size = 0, signed = 0;
      for (let c = 3 * p; c < 3 * p + 3; ++c) {
        const r = toFloat[truth[c]], e = (toFloat[value[c]] - r) / (Math.max(r, 0) + 0.01) / 3;
        size += Math.abs(e);
        signed += e;
      }
      return [size, signed];
    }

    // The picture, or its error, in the colours of the screen.
    paint(picture) {
      const { exposure, most } = this.state;
      const mode = this.reference && picture === this.pictures[0] ? "color" : this.state.mode;
      const key = mode === "color" ? `color ${exposure}` : `${mode} ${most}`;
      if (picture.drawn === key) return;
      picture.drawn = key;
      picture.pixels.width = this.width;
      picture.pixels.height = this.height;
      const context = picture.pixels.getContext("2d"), image = context.createImageData(this.width, this.height);
      const half = this.half(picture), to = image.data, count = this.width * this.height;
      if (mode === "color") {
        if (this.table.key !== exposure) {
          const factor = 2 ** exposure;
          for (let h = 0; h < 65536; ++h) this.table.bytes[h] = Math.round(255 * encode(clamp(toFloat[h] * factor || 0, 0, 1)));
          this.table.key = exposure;
        }
        for (let p = 0, i = 0, o = 0; p < count; ++p, i += 3, o += 4) {
          to[o] = this.table.bytes[half[i]];
          to[o + 1] = this.table.bytes[half[i + 1]];
          to[o + 2] = this.table.bytes[half[i + 2]];
          to[o + 3] = 255;
        }
      } else {
        const ramp = ramps[mode], last = ramp.length - 1;
        for (let p = 0, o = 0; p < count; ++p, o += 4) {
          const [size, signed] = this.errors(picture, p);
          const t = mode === "error" ? size / most : 0.5 + 0.5 * signed / most;
          if (Number.isNaN(t)) {
            to.set([0, 255, 0, 255], o);
            continue;
          }
          const at = clamp(t, 0, 1) * last, k = Math.min(Math.floor(at), last - 1);
          for (let c = 0; c < 3; ++c) to[o + c] = Math.round(255 * (ramp[k][c] + (ramp[k + 1][c] - ramp[k][c]) * (at - k)));
          to[o + 3] = 255;
        }
      }
      context.putImageData(image, 0, 0);
    }

    draw() {
      this.ready = true;
      const { state, figure } = this;
      this.stage.classList.toggle("all", state.all);
      for (const picture of this.pictures) picture.cell.hidden = !this.shown().includes(picture);
      for (const picture of this.shown()) {
        this.paint(picture);
        const canvas = picture.canvas, ratio = devicePixelRatio;
        if (this.paper) {
          Object.assign(canvas, { width: this.width, height: this.height });
          canvas.getContext("2d").drawImage(picture.pixels, 0, 0);
          continue;
        }
        const width = Math.max(1, Math.round(canvas.clientWidth * ratio)), height = Math.max(1, Math.round(canvas.clientHeight * ratio));
        if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
        const context = canvas.getContext("2d"), scale = this.scale(canvas) * ratio;
        context.setTransform(1, 0, 0, 1, 0, 0);
        context.fillStyle = "#777";
        context.fillRect(0, 0, width, height);
        context.imageSmoothingEnabled = scale < 1;
        context.imageSmoothingQuality = "high";
        context.setTransform(scale, 0, 0, scale, width / 2 - scale * state.x, height / 2 - scale * state.y);
        context.drawImage(picture.pixels, 0, 0);
      }
      this.buttons.forEach((b, i) => b.setAttribute("aria-pressed", i === state.image));
      for (const [mode, b] of Object.entries(this.modes)) b.setAttribute("aria-pressed", mode === state.mode);
      this.allButton.setAttribute("aria-pressed", state.all);
      this.slider.value = state.exposure;
      this.stops.textContent = `${state.exposure > 0 ? "+" : ""}${state.exposure} stops`;
      this.most.value = state.most;
      this.values();
      figure.dataset.state = JSON.stringify(state);
    }

    probe(x, y) {
      const inside = x >= 0 && y >= 0 && x < this.width && y < this.height;
      this.state.probe = inside ? [x, y] : null;
      this.values();
    }

    values() {
      const { probe } = this.state;
      this.place.textContent = probe ? `pixel ${probe[0]}, ${probe[1]}` : "pixel";
      this.readout.textContent = "";
      for (const [i, picture] of this.pictures.entries()) {
        picture.row.style.fontWeight = i === this.state.image && !this.state.all ? "600" : "";
        const cells = [...picture.row.children].slice(1);
        if (!probe) {
          for (const cell of cells) cell.textContent = "";
          continue;
        }
        const p = probe[1] * this.width + probe[0], half = this.half(picture);
        for (let c = 0; c < 3; ++c) cells[c].textContent = format(toFloat[half[3 * p + c]]);
        if (i === this.state.image)
          this.readout.textContent = `${this.place.textContent}: ${cells.slice(0, 3).map(c => c.textContent).join("  ")}`;
        if (cells.length > 3 && i > 0) this.errors(picture, p).forEach((e, k) => { cells[3 + k].textContent = format(e); });
      }
    }

    key(key) {
      const { state } = this, count = this.pictures.length;
      if (key >= "1" && key <= "9") this.show(+key - 1);
      else if (key === "ArrowRight") this.show((state.image + 1) % count);
      else if (key === "ArrowLeft") this.show((state.image + count - 1) % count);
      else if (key === " ") this.show(this.before);
      else if (key === "c") this.set({ mode: "color" });
      else if (key === "e" && this.modes.error) this.set({ mode: "error" });
      else if (key === "s" && this.modes.signed) this.set({ mode: "signed" });
      else if (key === "g") this.set({ all: !state.all });
      else if (key === "[") this.set({ exposure: Math.max(state.exposure - 0.5, -10) });
      else if (key === "]") this.set({ exposure: Math.min(state.exposure + 0.5, 10) });
      else if (key === "+" || key === "=") this.zoomAt(this.shown()[0], null, 2);
      else if (key === "-") this.zoomAt(this.shown()[0], null, 0.5);
      else if (key === "0") this.fit();
      else if (key === "p") this.actual();
      else return false;
      return true;
    }

    // "#id&image=2&mode=error&exposure=1&zoom=4&x=10&y=20&all=1&probe=3,4": a view that an address can name. All but
    // `id` may be missing; without `id` it means every viewer of the page. "key=e" presses keys.
    open(address) {
      const parts = address.replace(/^#/, "").split("&"), change = {}, keys = [];
      if (parts[0] && !parts[0].includes("=") && parts[0] !== this.figure.id) return false;
      for (const part of parts) {
        const [name, text] = part.split("=");
        if (name === "image") change.image = clamp(Math.floor(+text) - 1 || 0, 0, this.pictures.length - 1);
        else if (name === "mode" && this.modes[text]) change.mode = text;
        else if (name === "all") change.all = text === "1";
        else if (name === "probe") change.probe = text.split(",").map(Number);
        else if (name === "key") keys.push(decodeURIComponent(text));
        else if (["exposure", "zoom", "x", "y", "most"].includes(name) && Number.isFinite(+text)) change[name] = +text;
      }
      const [px, py] = change.probe ?? [-1, -1];
      if (!(px >= 0 && py >= 0 && px < this.width && py < this.height)) change.probe = null;
      this.set(change);
      for (const key of keys) this.key(key);
      return true;
    }
  }

  const viewers = [];
  let active = null;

  document.addEventListener("DOMContentLoaded", () => {
    const seen = new IntersectionObserver(entries => {
      for (const entry of entries) {
        const viewer = viewers.find(v => v.figure === entry.target);
        if (entry.isIntersecting && !viewer.ready) viewer.draw();
      }
    }, { rootMargin: "50%" });
    for (const figure of document.querySelectorAll("figure.octrad-viewer")) {
      const viewer = new Viewer(figure);
      viewers.push(viewer);
      if (location.hash.length > 1) viewer.open(location.hash);
      if (!viewer.ready && viewers.length === 1) viewer.draw();
      seen.observe(figure);
    }
    active = viewers[0];
  });
  addEventListener("hashchange", () => viewers.forEach(v => v.open(location.hash)));
  document.addEventListener("keydown", event => {
    const typing = /^(INPUT|SELECT|TEXTAREA)$/.test(event.target.tagName) && event.target.type !== "range";
    if (!active || typing || event.ctrlKey || event.altKey || event.metaKey) return;
    if (event.target.type === "range" && event.key.startsWith("Arrow")) return;
    if (event.target.tagName === "BUTTON" && event.key === " ") return;
    if (active.key(event.key)) event.preventDefault();
  });
  // On paper: all pictures of every viewer, whole, pixel by pixel.
  const print = paper => viewers.forEach(v => {
    if (paper) v.screen = { all: v.state.all };
    v.paper = paper;
    v.set(paper ? { all: true } : v.screen);
  });
  addEventListener("beforeprint", () => print(true));
  addEventListener("afterprint", () => print(false));
})();
)js";

}  // namespace octrad::report
