"""Sentences other rooms record in English (doubts, cures, notes), in Chinese where they are known.

What is not known stays as it was recorded: a reader would rather have it in English than not.
"""

from __future__ import annotations

import re
from typing import Final

_N: Final = r"(-?[\d.]+)"
_PATTERNS: Final[tuple[tuple[str, str], ...]] = (
    # Cures of what the data do not see; a name may stand before them
    (
        r"(.+?): add poses spread further over the joint ranges and tool orientations\.?",
        r"\1：增加在关节范围与工具姿态上分布更广的位姿",
    ),
    (
        r"(.+?): no torque about axis (\d+) in these poses \(gravity does not load a vertical "
        r"axis\); (.+?)\.?",
        r"\1：这些位姿中轴 \2 不受力矩（重力不作用于竖直轴）；\3",
    ),
    (
        r"(.+?): (measure some poses .+)",
        r"\1：\2",
    ),
    (
        r"(.*?)measure some poses under a known horizontal force; until then the stated stiffness "
        r"stands\.?",
        r"\1在已知水平力作用下测量若干位姿；在此之前采用所给定的刚度",
    ),
    (
        r"(.*?)measure some poses under a known horizontal force, or state the stiffness\.?",
        r"\1在已知水平力下测量部分位姿，或给出刚度",
    ),
    (
        r"(.*?)measure some poses under a known horizontal force\.?",
        r"\1在已知水平力作用下测量若干位姿",
    ),
    (r"not seen by the data: (.+)", r"数据未能确定：\1"),
    # Doubts about a fit
    (
        rf"{_N} numbers for {_N} parameters: leans on the prior\.",
        r"\1 个测量值对应 \2 个参数：结果依赖先验。",
    ),
    (
        rf"{_N} of {_N} rows carry no weight \(row {_N} first\): their residual has a chance below "
        r"one in a million under the fitted noise\.",
        r"\2 行中有 \1 行权重为零（首个为第 \3 行）：在拟合噪声下其残差出现的概率低于百万分之一。",
    ),
    (
        r"(\w+) is negative beyond its uncertainty: check masses and loads\.",
        r"\1 为负且超出其不确定度：请检查质量与载荷。",
    ),
    (
        r"joints \[([\d, ]+)\] show no ripple here: there is none, or the reflector is on the "
        r"axis\.",
        r"关节 \1 未显示周期误差：或不存在，或靶球位于该轴上。",
    ),
    (
        r"the approach direction of no row is known: backlash was not learned\.",
        r"所有行的接近方向未知：未学习反向间隙。",
    ),
    (
        r"the smooth residual is that of the measured point; other tools inherit it\.",
        r"平滑残差来自被测点；其他工具沿用该残差。",
    ),
    (
        r"held-out blocks are off by more than the model expects \(variance times "
        rf"{_N}\): something drifts or is not modelled\.",
        r"留出数据块的偏差超出模型预期（方差为 \1 倍）：存在漂移或未建模因素。",
    ),
    # Doubts about a check
    (
        rf"Only {_N} poses: the largest error and the coverage mean little; at least {_N} are "
        r"asked for\.",
        r"仅有 \1 个位姿：最大误差与覆盖率意义不大；要求至少 \2 个。",
    ),
    (
        rf"{_N} of {_N} poses have a joint outside the range the model was trained in: there it "
        r"extrapolates\.",
        r"\2 个位姿中有 \1 个的关节超出模型的训练范围：该处为外推。",
    ),
    (
        rf"A mean of {_N} mm is below the {_N} mm that instrument and repeatability \({_N} mm\) "
        r"allow for one visit per pose: averaged, simulated, or seen by the fit\.",
        r"平均值 \1 mm 低于仪器与重复性（\3 mm）在单次到位时所允许的 \2 mm："
        r"数据可能经过平均、为仿真数据或曾参与拟合。",
    ),
    (
        rf"Correcting base and tool alone gives {_N} mm on these poses, the model {_N} mm: the "
        r"model is no better than a frame correction here\.",
        r"在这些位姿上仅修正基座与工具可得 \1 mm，模型为 \2 mm：模型在此不优于坐标系修正。",
    ),
    (
        r"Several reflectors in one set: the model predicts one tool point for all\.",
        r"同一组数据中有多个靶球：模型对所有靶球预测同一个工具点。",
    ),
    (
        r"The fit saw exactly these poses: the errors say how well the model bends, not how well "
        r"it predicts\. Validate on poses held back\.",
        r"拟合使用的正是这些位姿：误差只说明拟合程度，不说明预测能力。请用留出的位姿检验。",
    ),
    (
        r"The fit used rows of the same file \((.+)\): the numbers hold only if these poses were "
        r"held back\.",
        r"拟合使用了同一文件（\1）中的行：仅当这些位姿确实被留出时，以上数值才成立。",
    ),
    (
        rf"The stated {_N} % regions hold {_N} % of the poses \(interval {_N} to {_N} %\): the "
        r"stated uncertainty is too small here\.",
        r"声明的 \1 % 区域包含了 \2 % 的位姿（区间 \3 至 \4 %）：此处声明的不确定度偏小。",
    ),
    (
        rf"The stated {_N} % regions hold {_N} % of the poses \(interval {_N} to {_N} %\): the "
        r"stated uncertainty is too large here\.",
        r"声明的 \1 % 区域包含了 \2 % 的位姿（区间 \3 至 \4 %）：此处声明的不确定度偏大。",
    ),
    # Notes of a plan
    (
        r"The tracker's place in the base is not known: line of sight was not checked, and every "
        r"point counts as 3 m away \(tracker\.place_mm\)\.",
        r"跟踪仪在基座中的位置未知：未检查视线，所有点按 3 m 距离计（tracker.place_mm）。",
    ),
    (
        r"The way the reflector looks is not known: its acceptance angle was not checked "
        r"\(target\.axis, target\.acceptance_deg\)\.",
        r"靶球朝向未知：未检查其接收角（target.axis、target.acceptance_deg）。",
    ),
    (
        rf"The links were taken as tubes of {_N} % and {_N} % of the reach\.",
        r"各连杆按半径为臂展 \1 % 与 \2 % 的圆管处理。",
    ),
    (r"No obstacles are stated, not even the floor\.", r"未给出任何障碍物，包括地面。"),
    (
        r"Every joint enters every pose in its positive sense: backlash then looks like an offset "
        r"and holds for poses that are entered from that side\.",
        r"各关节均沿正方向进入每个位姿：反向间隙表现为固定偏移，仅对从该侧进入的位姿成立。",
    ),
    # Notes of a check
    (
        r"Positions were measured in the tracker's frame; 'before' uses the station the model "
        r"estimated, so an error of the base frame is not in it\.",
        r"位置在跟踪仪坐标系中测得；“修正前”采用模型估计的测站，因此不含基座坐标系误差。",
    ),
    (
        r"'Base and tool aligned' fits base frame and tool point to these very rows: what a frame "
        r"correction alone is worth\.",
        r"“仅对齐基座与工具”以这些行拟合基座与工具点：表示仅修正坐标系的效果。",
    ),
    (
        r"Tool axis angles leave out the constant rotation of the target on the tool\.",
        r"工具轴线角度已扣除靶标在工具上的固定转角。",
    ),
    (rf"Temperature {_N} to {_N} deg C\.", r"温度 \1 至 \2 °C。"),
    (rf"{_N} of {_N} poses under an external wrench\.", r"\2 个位姿中有 \1 个受外力作用。"),
    (r"Joint ranges of these poses: (.+) deg\.", r"这些位姿的关节范围：\1 deg。"),
)
_COMPILED: Final = tuple((re.compile(pattern), meant) for pattern, meant in _PATTERNS)


def in_chinese(sentence: str) -> str:
    """Returns the sentence in Chinese, part by part where several are known, or as it stands."""
    for pattern, meant in _COMPILED:
        found = pattern.fullmatch(sentence)
        if found is None:
            continue
        changed = found.expand(meant)
        return in_chinese(changed) if changed != sentence else sentence
    return sentence
