"""The look of the page: one palette in two lightings, one style sheet, no foreign host.

Plots are drawn in the light palette's exact colours; :mod:`robotrue.report.figure` turns each of
these colours into its CSS variable, so one SVG serves light, dark and print.
"""

from __future__ import annotations

from typing import Final

LIGHT: Final = {
    "page": "#f4f6f8",
    "card": "#fefefe",
    "ink": "#1a2430",
    "muted": "#5a6877",
    "rule": "#d8dee5",
    "before": "#c2571a",
    "after": "#0f6cab",
    "good": "#1d7a46",
    "caution": "#9a6a00",
    "bad": "#b3261e",
    "band": "#dce9f4",
}
DARK: Final = {
    "page": "#12171d",
    "card": "#1a2129",
    "ink": "#e4e9ee",
    "muted": "#99a6b3",
    "rule": "#34404c",
    "before": "#f09a5b",
    "after": "#6bb5f0",
    "good": "#62c68c",
    "caution": "#e0b04a",
    "bad": "#f2827a",
    "band": "#22384b",
}


def _variables(palette: dict[str, str]) -> str:
    return "".join(f"--{name}:{value};" for name, value in palette.items())


STYLE: Final = (
    ":root{color-scheme:light dark;"
    + _variables(LIGHT)
    + "}@media (prefers-color-scheme:dark){:root{"
    + _variables(DARK)
    + "}}@media print{:root{color-scheme:light;"
    + _variables(LIGHT | {"page": "#fefefe"})
    + "}}"
    + """
*{box-sizing:border-box}
html{-webkit-text-size-adjust:100%}
body{margin:0;background:var(--page);color:var(--ink);
 font:16px/1.55 system-ui,-apple-system,"Segoe UI",Roboto,"Helvetica Neue",Arial,sans-serif;
 font-variant-numeric:tabular-nums}
html:lang(zh) body{font-family:system-ui,-apple-system,"PingFang SC","Microsoft YaHei",
 "Noto Sans CJK SC","Noto Sans SC","Source Han Sans SC","WenQuanYi Micro Hei",sans-serif}
main{max-width:1080px;margin:0 auto;padding:32px 24px 64px}
h1{font-size:30px;line-height:1.2;margin:0 0 4px;letter-spacing:-.01em}
h2{font-size:21px;line-height:1.3;margin:48px 0 4px;letter-spacing:-.005em}
h3{font-size:16px;line-height:1.4;margin:0 0 4px}
p{margin:0 0 8px;max-width:88ch}
.subtitle,.caption,.note{color:var(--muted)}
.caption,.note{font-size:14px}
.simulated{background:var(--caution);color:var(--card);font-weight:700;letter-spacing:.06em;
 text-align:center;padding:8px 16px}
.verdict{margin:24px 0;padding:20px 24px;background:var(--card);border:1px solid var(--rule);
 border-left:6px solid var(--tone);border-radius:8px}
.verdict strong{display:block;font-size:23px;line-height:1.35;font-weight:650;
 text-wrap:balance}
.verdict span{color:var(--muted)}
.plain{--tone:var(--after)}.good{--tone:var(--good)}.caution{--tone:var(--caution)}
.bad{--tone:var(--bad)}
.tiles{display:grid;grid-template-columns:repeat(auto-fit,minmax(170px,1fr));gap:12px;
 margin:0 0 8px}
.tile{background:var(--card);border:1px solid var(--rule);border-radius:8px;padding:14px 16px}
.tile .label{font-size:14px;color:var(--muted)}
.tile .value{font-size:29px;font-weight:650;line-height:1.25;white-space:nowrap}
.tile.good .value,.tile.caution .value,.tile.bad .value{color:var(--tone)}
.tile .unit{font-size:16px;font-weight:400;color:var(--muted);margin-left:4px}
.tile .was{font-size:14px;color:var(--before)}
.card{background:var(--card);border:1px solid var(--rule);border-radius:8px;padding:18px 20px;
 margin:16px 0;overflow-x:auto}
.card svg{display:block;width:100%;height:auto;margin:8px 0 4px}
.card svg text{font-family:inherit}
table{border-collapse:collapse;width:100%;font-size:15px;margin:8px 0 4px}
th,td{padding:6px 12px;text-align:right;border-bottom:1px solid var(--rule);vertical-align:top}
th{font-weight:600;color:var(--muted);font-size:14px;white-space:nowrap}
th .unit{font-weight:400}
th.words,td.words{text-align:left}
td{white-space:nowrap}td.words{white-space:normal}
table.wide th,table.wide td{padding:6px 7px;font-size:13px}
th:first-child,td:first-child{padding-left:4px}
tr:last-child td{border-bottom:0}
tr.chosen td{background:var(--band);font-weight:600}
ul{margin:8px 0;padding-left:20px;max-width:80ch}li{margin:4px 0}
dl{display:grid;grid-template-columns:max-content 1fr;gap:4px 20px;margin:8px 0;font-size:14px}
dt{color:var(--muted)}dd{margin:0;overflow-wrap:anywhere}
footer{margin-top:40px;color:var(--muted);font-size:13px}
@media (max-width:640px){main{padding:20px 14px 40px}.verdict strong{font-size:20px}
 dl{grid-template-columns:1fr;gap:0}dd{margin-bottom:6px}}
@media print{body{font-size:11pt}main{max-width:none;padding:0}.card,.tile,.verdict,tr{
 break-inside:avoid}h2{break-after:avoid}.simulated{border:2px solid var(--caution);
 background:none;color:var(--caution)}}
"""
)
