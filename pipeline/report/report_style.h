// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace meshwright {

constexpr char kReportStyle[] = R"css(
:root { color-scheme: light dark; --page: #f6f7f9; --card: #ffffff; --text: #1b2330; --muted: #5b6676; --line: #dde2ea;
  --covered: #7d8ba0; --accepted: #1f8f5f; --unconfirmed: #d08a1a; --empty: #dfe4ec; --danger: #b3261e; }
@media (prefers-color-scheme: dark) { :root { --page: #14181f; --card: #1d232c; --text: #e6eaf0; --muted: #9aa6b6;
  --line: #303947; --covered: #8494ab; --accepted: #41b883; --unconfirmed: #e0a23a; --empty: #343e4d; --danger: #ff8a80; } }
* { box-sizing: border-box; }
body { margin: 0; background: var(--page); color: var(--text); font: 15px/1.5 system-ui, sans-serif; }
main { max-width: 1200px; margin: 0 auto; padding: 24px 16px 48px; }
h1 { font-size: 26px; margin: 0 0 4px; overflow-wrap: anywhere; }
h2 { font-size: 18px; margin: 0 0 12px; }
p { margin: 0 0 12px; }
section { background: var(--card); border: 1px solid var(--line); border-radius: 10px; padding: 18px; margin-top: 16px; }
.muted { color: var(--muted); }
.small { font-size: 13px; }
.danger { color: var(--danger); }
.facts { display: grid; grid-template-columns: repeat(auto-fit, minmax(150px, 1fr)); gap: 12px; margin: 0; }
.facts dt { color: var(--muted); font-size: 13px; }
.facts dd { margin: 0; font-size: 19px; font-variant-numeric: tabular-nums; }
.views { display: grid; grid-template-columns: repeat(auto-fit, minmax(320px, 1fr)); gap: 16px; }
figure { margin: 0; }
figure img { width: 100%; display: block; border-radius: 6px; }
figcaption { color: var(--muted); font-size: 13px; margin-top: 4px; overflow-wrap: anywhere; }
.bar { display: flex; height: 18px; border-radius: 4px; overflow: hidden; background: var(--empty); }
.bar.thin { height: 8px; margin: 6px 0; }
.bar span { display: block; }
.key { display: flex; flex-wrap: wrap; gap: 4px 18px; margin-top: 8px; font-size: 13px; }
.key i { display: inline-block; width: 11px; height: 11px; border-radius: 3px; margin-right: 6px; }
.covered { background: var(--covered); } .accepted { background: var(--accepted); }
.unconfirmed { background: var(--unconfirmed); } .empty { background: var(--empty); }
.photographs { display: grid; grid-template-columns: repeat(auto-fill, minmax(190px, 1fr)); gap: 14px; }
.photograph { border: 1px solid var(--line); border-radius: 8px; padding: 8px; min-width: 0; }
.photograph img { width: 100%; display: block; border-radius: 4px; }
.photograph h3 { font-size: 13px; margin: 6px 0 0; overflow: hidden; text-overflow: ellipsis; white-space: nowrap; }
.photograph p { margin: 0; font-size: 12px; }
.scroll { overflow-x: auto; }
table { border-collapse: collapse; width: 100%; font-size: 13px; font-variant-numeric: tabular-nums; }
th, td { text-align: right; padding: 4px 8px; border-bottom: 1px solid var(--line); white-space: nowrap; }
th:first-child, td:first-child { text-align: left; white-space: normal; overflow-wrap: anywhere; }
summary { cursor: pointer; font-weight: 600; }
@media print { section { break-inside: avoid; } }
)css";

}  // namespace meshwright
