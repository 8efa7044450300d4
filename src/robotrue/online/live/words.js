// What the page says, in English and Chinese.

const WORDS = {
  en: {
    limit: "Limit", window: "Window", language: "中文", pause: "Pause", resume: "Go on",
    scaleSame: "Same scale", scaleEach: "Own scales", paused: "Paused: the picture stands still",
    errorNow: "Error of the tool point, um", forceNow: "Process force on the tool", joints: "Joints as displayed, deg",
    now: "now", static: "static", peak: "peak shown", links: "Sources and sinks",
    name: "address", there: "link", received: "received", lost: "lost", late: "late", refused: "refused",
    dropped: "left out", reconnects: "came back", turnaround: "answer p50 / p99 ms", fault: "latest fault",
    yes: "● up", no: "○ down", waiting: "waiting for the service", connected: "connected",
    gone: "no connection to the service, trying again",
    good: "✓ Valid", wary: "! Valid, with a wider band", bad: "✕ No estimate",
    stale: "✕ Nothing has come for {s} s", idle: "Waiting for the first estimate",
    errorTitle: "e{a}  um", forceTitle: "force  N", turnsTitle: "joints less their mean  deg", nothing: "nothing came",
    simulated: "simulated", token: "Token of this cell", refusedToken: "The service let nobody in: token, origin or host.",
    counts: "{r} updates/s come, {p} painted/s, {d} left out for this viewer",
    legend: "Filled: smallest to largest. Pale: ± 2σ. Hatched: no valid estimate, never joined by a line. Base axes, actual minus programmed. Space: pause.",
    no_joints: "no joints", bad_joints: "joints flagged", bad_force: "force flagged",
    outside: "outside the models", settling: "settling", clock: "clocks unsure", extrapolated: "physics alone",
  },
  zh: {
    limit: "限值", window: "时间窗", language: "English", pause: "暂停", resume: "继续",
    scaleSame: "统一刻度", scaleEach: "各自刻度", paused: "已暂停：图形静止",
    errorNow: "刀尖点误差，um", forceNow: "作用于刀具的加工力", joints: "关节角（控制器显示值），deg",
    now: "当前", static: "静态", peak: "窗内峰值", links: "数据源与输出",
    name: "地址", there: "连接", received: "已接收", lost: "丢失", late: "迟到", refused: "拒收",
    dropped: "略去", reconnects: "重连", turnaround: "应答 p50 / p99 ms", fault: "最近故障",
    yes: "● 已连接", no: "○ 断开", waiting: "等待服务", connected: "已连接",
    gone: "与服务的连接中断，正在重试",
    good: "✓ 有效", wary: "! 有效，误差带较宽", bad: "✕ 无估计值",
    stale: "✕ {s} s 内无数据", idle: "等待首个估计值",
    errorTitle: "e{a}  um", forceTitle: "力  N", turnsTitle: "关节角减窗内均值  deg", nothing: "无数据",
    simulated: "仿真数据", token: "本单元的令牌", refusedToken: "服务拒绝访问：令牌、来源或主机不符。",
    counts: "每秒到达 {r} 次更新，绘制 {p} 次，本页略去 {d} 次",
    legend: "深色：最小至最大值。浅色：± 2σ。斜线：无有效估计，绝不连线。基座坐标系，实际减编程。空格键：暂停。",
    no_joints: "无关节数据", bad_joints: "关节数据异常", bad_force: "力数据异常",
    outside: "超出模型范围", settling: "滤波器稳定中", clock: "时钟不确定", extrapolated: "仅物理模型",
  },
};

let language = localStorage.getItem("language") ??
  (navigator.languages?.[0] ?? navigator.language ?? "en").toLowerCase();
language = language.startsWith("zh") ? "zh" : "en";

export function speak(chosen) {
  language = chosen;
}

export function word(name, values = {}) {
  const text = WORDS[language][name] ?? name;
  return text.replace(/\{(\w+)\}/g, (_, key) => String(values[key]));
}

export function otherLanguage() {
  language = language === "zh" ? "en" : "zh";
  localStorage.setItem("language", language);
}

// Writes every fixed text of the page.
export function settle() {
  document.documentElement.lang = language === "zh" ? "zh-CN" : "en";
  for (const node of document.querySelectorAll("[data-word]")) node.textContent = word(node.dataset.word);
}
