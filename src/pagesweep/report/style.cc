// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/report/html.h"

namespace pagesweep {

namespace {

constexpr std::string_view style = R"css(
:root { color-scheme: light dark;
  --paper: #fbfaf8; --card: #ffffff; --ink: #22252b; --soft: #666c77; --line: #e3e1dc; --accent: #2f6f8f;
  --good: #2e8b57; --look: #c98a1b; --scan_again: #c0392b; }
@media (prefers-color-scheme: dark) { :root {
  --paper: #17191d; --card: #1f2228; --ink: #e6e6e3; --soft: #9aa1ad; --line: #33373f; --accent: #74b5d4;
  --good: #57b886; --look: #e0ae4c; --scan_again: #e57362; } }
* { box-sizing: border-box; }
body { margin: 0 auto; padding: 3rem 2rem 4rem; max-width: 1180px; background: var(--paper); color: var(--ink);
  font: 16px/1.55 "Source Sans 3", "Segoe UI", "Helvetica Neue", Lato, system-ui, sans-serif; }
header p.kicker { margin: 0; color: var(--soft); font-size: .85rem; letter-spacing: .04em; }
h1 { margin: .1rem 0 1.6rem; font-size: 1.5rem; font-weight: 600; overflow-wrap: anywhere; }
h2 { margin: 3.2rem 0 .4rem; font-size: 1.2rem; font-weight: 600; }
h3 { margin: 1.8rem 0 .5rem; font-size: 1rem; font-weight: 600; }
p.lead { margin: 0 0 1.2rem; max-width: 46rem; color: var(--soft); }
.verdict { --level: var(--accent); padding: 1.3rem 1.6rem; background: var(--card); border: 1px solid var(--line); border-radius: 8px;
  border-left: 6px solid var(--level); }
.verdict.good { --level: var(--good); } .verdict.look { --level: var(--look); }
.verdict.scan_again { --level: var(--scan_again); }
.verdict p { margin: 0; } .verdict .headline { font-size: 1.45rem; line-height: 1.35; font-weight: 600; }
.verdict .advice { margin-top: .3rem; color: var(--level); font-weight: 600; }
.verdict ul { margin: .8rem 0 0; padding-left: 1.1rem; color: var(--soft); } .verdict li { margin: .2rem 0; }
.tiles { display: grid; grid-template-columns: repeat(auto-fit, minmax(172px, 1fr)); gap: 1px; margin: 1.4rem 0 0;
  background: var(--line); border: 1px solid var(--line); border-radius: 8px; overflow: hidden; }
.tiles div { padding: .8rem 1rem; background: var(--card); }
.tiles b { display: block; white-space: nowrap; font-size: 1.22rem; font-weight: 600; font-variant-numeric: tabular-nums; }
.tiles b small { font-size: .9rem; font-weight: 400; color: var(--soft); }
.tiles span { color: var(--soft); font-size: .85rem; }
.row { display: grid; gap: 1.6rem; align-items: start; margin-bottom: 1.6rem; }
.two { grid-template-columns: 1fr 1fr; } .three { grid-template-columns: repeat(3, 1fr); } .four { grid-template-columns: repeat(4, 1fr); }
.wide { grid-template-columns: minmax(0, 2fr) minmax(0, 1fr); }
.surface { grid-template-columns: minmax(0, 2.3fr) repeat(auto-fit, minmax(180px, 1fr)); }
@media (max-width: 800px) { .two, .three, .wide, .surface { grid-template-columns: 1fr; } .four { grid-template-columns: 1fr 1fr; } }
figure { margin: 0; } figure img { display: block; width: 100%; height: auto; border-radius: 4px;
  border: 1px solid var(--line); background: #d6d8db; }
figcaption { margin-top: .45rem; color: var(--soft); font-size: .88rem; line-height: 1.45; }
figcaption b { color: var(--ink); font-weight: 600; }
.bar { display: grid; grid-template-columns: 1fr 1fr 1fr; margin-top: .5rem; color: var(--soft); font-size: .78rem;
  font-variant-numeric: tabular-nums; }
.bar div { grid-column: 1 / 4; height: .5rem; border-radius: 3px; margin-bottom: .15rem; print-color-adjust: exact;
  -webkit-print-color-adjust: exact; }
.bar span:nth-of-type(2) { text-align: center; } .bar span:nth-of-type(3) { text-align: right; }
table { border-collapse: collapse; width: 100%; font-size: .92rem; }
td, th { padding: .28rem .6rem .28rem 0; text-align: left; vertical-align: top; border-bottom: 1px solid var(--line);
  font-weight: 400; overflow-wrap: anywhere; }
th { color: var(--soft); font-size: .82rem; } td.n, th.n { text-align: right; font-variant-numeric: tabular-nums;
  white-space: nowrap; padding-right: 0; padding-left: .8rem; }
table.figures { break-inside: avoid; margin-bottom: 1.4rem; }
table.figures th { color: var(--ink); font-weight: 600; font-size: .92rem; }
.figures-columns { columns: 2; column-gap: 2.4rem; margin-top: 1rem; } @media (max-width: 800px) { .figures-columns { columns: 1; } }
.u, .why { color: var(--soft); font-size: .85em; } .u { display: inline-block; min-width: 2.9rem; text-align: left; }
.swatch { display: inline-block; width: .8em; height: .8em; margin-right: .5em; border-radius: 2px;
  border: 1px solid var(--line); vertical-align: -.05em; print-color-adjust: exact; -webkit-print-color-adjust: exact; }
svg.plot { width: 100%; height: auto; display: block; } svg .grid { stroke: var(--line); fill: none; }
svg .curve { stroke: var(--accent); stroke-width: 2; fill: none; } svg .area { fill: var(--accent); opacity: .14; }
svg text { fill: var(--soft); font-size: 12px; text-anchor: middle; }
details summary { cursor: pointer; color: var(--accent); }
footer { margin-top: 4rem; color: var(--soft); font-size: .82rem; }
@media print { :root { --paper: #fff; --card: #fff; --ink: #000; --soft: #444; --line: #ccc; }
  body { padding: 0; max-width: none; font-size: 10pt; } h2 { margin-top: 1.6rem; }
  figure, .verdict, tr { break-inside: avoid; } h2, h3, .lead { break-after: avoid; } }
)css";

}  // namespace

std::string_view report_style() { return style; }

}  // namespace pagesweep
