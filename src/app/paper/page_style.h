// Style and script of the report's page, after those of its viewers (app/report/image_page.h).
#pragma once

namespace octrad::paper {

inline constexpr const char* kPageStyle = R"css(
body { font: 15px/1.45 system-ui, sans-serif; color: #111; background: #fff; max-width: 1280px; margin: 1.5em auto; padding: 0 1em; }
h1 { font-size: 1.7em; } h2 { font-size: 1.35em; margin-top: 2em; border-bottom: 1px solid #888; } h3 { font-size: 1.1em; margin: 1.4em 0 .4em; } h4 { margin: 1em 0 .3em; }
a { color: #024a8c; }
.scaled { border-left: 4px solid #d55e00; padding: .3em .8em; background: #fdf3ea; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; font-size: .92em; }
th, td { padding: .15em .45em; text-align: right; white-space: nowrap; }
th:first-child, td:first-child, td.text { text-align: left; }
td.text { white-space: normal; font-size: .85em; min-width: 12em; }
thead tr:last-child th { border-bottom: 1px solid #444; } thead tr:first-child th { border-top: 1px solid #444; } th.group { border-left: 1px solid #bbb; text-align: center; }
tbody tr:last-child td { border-bottom: 1px solid #444; } tbody tr:hover { background: #f3f3f3; }
.best { font-weight: 700; } .published { color: #6a3d00; font-style: italic; background: #fbf5ec; }
.note { font-size: .85em; color: #444; max-width: 75em; }
pre { font-size: .78em; line-height: 1.35; overflow-x: auto; background: #f5f5f5; padding: .4em .6em; margin: .3em 0 .8em; white-space: pre-wrap; overflow-wrap: anywhere; }
pre code { display: block; } details summary { cursor: pointer; font-size: .85em; color: #444; }
.plots { display: flex; flex-wrap: wrap; gap: 1em; } figure { margin: 0; } figcaption { font-size: .82em; color: #222; }
.plotted { max-width: 680px; } svg.plot { max-width: 100%; height: auto; font: 12px system-ui, sans-serif; } svg .grid { stroke: #ddd; } svg .frame { fill: none; stroke: #444; }
.pictures { display: grid; grid-template-columns: repeat(auto-fill, minmax(250px, 1fr)); gap: .8em; } .pictures.small { grid-template-columns: repeat(auto-fill, minmax(170px, 1fr)); }
.pictures img { display: block; } .pictures .shown { width: 100%; height: auto; }
.below { display: flex; gap: 4px; margin-top: 4px; } .below img { height: 96px; width: auto; } .inset { image-rendering: pixelated; }
@media print {
  body { max-width: none; margin: 0; font-size: 9.5pt; } .octrad-viewer, .screen, details:not([open]) { display: none; } .wide { overflow: visible; } table { font-size: 7.5pt; } th, td { padding: .1em .3em; }
  h2 ~ h2 { break-before: page; } h3, h4, h5 { break-after: avoid; } figure, tr { break-inside: avoid; } a { color: inherit; text-decoration: none; } pre { font-size: 6.5pt; background: none; border-left: 2px solid #999; }
  .pictures { grid-template-columns: repeat(4, 1fr); } .published { background: none; } * { print-color-adjust: exact; -webkit-print-color-adjust: exact; }
}
)css";

// Commands are printed too.
inline constexpr const char* kPageScript =
    "addEventListener('beforeprint', () => document.querySelectorAll('details').forEach(d => { d.open = true; }));";

}  // namespace octrad::paper
