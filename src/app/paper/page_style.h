// Style and script of the report's page.
#pragma once

namespace octrad::paper {

inline constexpr const char* kPageStyle = R"css(
body { font: 15px/1.45 system-ui, sans-serif; color: #111; background: #fff; max-width: 1200px; margin: 1.5em auto; padding: 0 1em; }
h1 { font-size: 1.7em; } h2 { font-size: 1.35em; margin-top: 2em; border-bottom: 1px solid #888; } h3 { font-size: 1.1em; margin: 1.4em 0 .4em; } h4 { margin: 1em 0 .3em; }
a { color: #024a8c; }
.scaled { border-left: 4px solid #d55e00; padding: .3em .8em; background: #fdf3ea; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; font-size: .92em; }
th, td { padding: .15em .55em; text-align: right; white-space: nowrap; }
th:first-child, td:first-child, td.text { text-align: left; }
td.text { white-space: normal; font-size: .85em; min-width: 12em; }
thead tr:last-child th { border-bottom: 1px solid #444; } thead tr:first-child th { border-top: 1px solid #444; } th.group { border-left: 1px solid #bbb; text-align: center; }
tbody tr:last-child td { border-bottom: 1px solid #444; } tbody tr:hover { background: #f3f3f3; }
.best { font-weight: 700; } .published { color: #6a3d00; font-style: italic; background: #fbf5ec; }
.note { font-size: .85em; color: #444; max-width: 75em; }
pre { font-size: .78em; line-height: 1.35; overflow-x: auto; background: #f5f5f5; padding: .4em .6em; margin: .3em 0 .8em; white-space: pre-wrap; overflow-wrap: anywhere; }
pre code { display: block; } details summary { cursor: pointer; font-size: .85em; color: #444; }
.plots { display: flex; flex-wrap: wrap; gap: 1em; } figure { margin: 0; } figcaption { font-size: .82em; color: #222; }
.plotted { max-width: 640px; } svg.plot { max-width: 100%; height: auto; font: 12px system-ui, sans-serif; } svg .grid { stroke: #ddd; } svg .frame { fill: none; stroke: #444; }
.pictures { display: grid; grid-template-columns: repeat(auto-fill, minmax(250px, 1fr)); gap: .8em; } .pictures.small { grid-template-columns: repeat(auto-fill, minmax(170px, 1fr)); }
.pictures img { display: block; } .pictures .shown { width: 100%; height: auto; cursor: zoom-in; }
.below { display: flex; gap: 4px; margin-top: 4px; } .below img { height: 96px; width: auto; } .inset { image-rendering: pixelated; }
#flip { position: fixed; inset: 0; background: #222; color: #eee; display: none; overflow: hidden; cursor: grab; } #flip.open { display: block; }
#flip img { position: absolute; left: 0; top: 0; transform-origin: 0 0; image-rendering: pixelated; max-width: none; }
#flip div { position: absolute; left: 0; right: 0; bottom: 0; padding: .4em 1em; background: #000a; font-size: .95em; pointer-events: none; }
@media print {
  body { max-width: none; margin: 0; font-size: 9.5pt; } .screen, details:not([open]) { display: none; } .wide { overflow: visible; } table { font-size: 7.5pt; } th, td { padding: .1em .3em; }
  h2 { break-before: page; } figure, tr { break-inside: avoid; } a { color: inherit; text-decoration: none; } pre { font-size: 6.5pt; background: none; border-left: 2px solid #999; }
  .pictures { grid-template-columns: repeat(4, 1fr); } .published { background: none; } * { print-color-adjust: exact; -webkit-print-color-adjust: exact; }
}
)css";

// Flips through the pictures of one view with linked zoom.
inline constexpr const char* kPageScript = R"js(
(() => {
  const box = document.createElement('div'); box.id = 'flip';
  const img = document.createElement('img'), text = document.createElement('div');
  box.append(img, text); document.body.append(box);
  let list = [], at = 0, scale = 1, x = 0, y = 0;
  const place = () => { img.style.transform = `translate(${x}px, ${y}px) scale(${scale})`; };
  const show = i => {
    at = (i + list.length) % list.length;
    img.src = list[at].src;
    const caption = list[at].closest('figure').querySelector('figcaption');
    text.textContent = `${at + 1}/${list.length}  ${caption ? caption.innerText.replace('\n', ' — ') : ''}`;
  };
  const open = picture => {
    list = [...picture.closest('.pictures').querySelectorAll('img.shown')];
    box.classList.add('open');
    const w = picture.getAttribute('width'), h = picture.getAttribute('height');
    scale = Math.min(innerWidth / w, (innerHeight - 40) / h); x = (innerWidth - w * scale) / 2; y = 0;
    place(); show(list.indexOf(picture));
  };
  document.querySelectorAll('.pictures img.shown').forEach(p => p.addEventListener('click', () => open(p)));
  addEventListener('keydown', e => {
    if (!box.classList.contains('open')) return;
    if (e.key === 'Escape') box.classList.remove('open');
    else if (e.key === 'ArrowRight' || e.key === ' ') show(at + 1);
    else if (e.key === 'ArrowLeft') show(at - 1);
    else if (/^[1-9]$/.test(e.key) && e.key <= list.length) show(e.key - 1);
    else return;
    e.preventDefault();
  });
  box.addEventListener('wheel', e => {
    const f = Math.exp(-e.deltaY / 400);
    x = e.clientX - (e.clientX - x) * f; y = e.clientY - (e.clientY - y) * f; scale *= f;
    place(); e.preventDefault();
  }, { passive: false });
  let drag = null;
  box.addEventListener('pointerdown', e => { drag = [e.clientX - x, e.clientY - y]; box.setPointerCapture(e.pointerId); e.preventDefault(); });
  box.addEventListener('pointermove', e => { if (drag) { x = e.clientX - drag[0]; y = e.clientY - drag[1]; place(); } });
  box.addEventListener('pointerup', () => { drag = null; });
  addEventListener('beforeprint', () => document.querySelectorAll('details').forEach(d => { d.open = true; }));
})();
)js";

}  // namespace octrad::paper
