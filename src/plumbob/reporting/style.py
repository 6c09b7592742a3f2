"""What pages and pictures share: colours, languages, and their labels in Chinese, in the terms of papers in Chinese."""

import re
from itertools import product
from typing import Final, Self

LANGUAGES: Final = ("en", "zh")
"""Of the labels of pages and pictures."""

# After Okabe and Ito, distinguished by colour-blind readers; the names are CSS variables of the page.
PALETTE: Final = {
    "#0072b2": "blue",
    "#d55e00": "red",
    "#009e73": "green",
    "#cc79a7": "pink",
    "#e69f00": "amber",
    "#56b4e9": "sky",
    "#8a6d00": "olive",
}
INK, MUTED, GRID, SHADE, SOFT = "#1b1f24", "#5b6570", "#d8dde2", "#e9edf1", "#aab4be"
SERIES: Final = tuple(PALETTE)

_APART = re.compile(r"(: |, | \[[^\]]*\])")
_NUMBER = re.compile(r"\d+(?:\.\d+)?")


class Both(str):
    """English text that carries its Chinese, for sentences that no dictionary of labels could hold.

    Parameters
    ----------
    en, zh : str
        The text in both languages. As a string, it is the English one.
    """

    zh: str

    def __new__(cls, en: str, zh: str) -> Self:
        """Make it of both."""
        made = super().__new__(cls, en)
        made.zh = zh
        return made

    def __str__(self) -> str:
        """Itself: what asks for a string, as a plot's label does, keeps the Chinese."""
        return self

    def __reduce__(self) -> tuple[type, tuple[str, str]]:
        """What makes it again."""
        return type(self), (self[:], self.zh)


def said(label: str, lang: str) -> str:
    """A label in a language; what is not a label stays as it is.

    Parts of a label that stand apart by a colon, a comma or a unit in brackets are looked up one by one, where the
    first of them is known; a number in it stands as # in the dictionary.
    """
    if isinstance(label, Both):
        return label[:] if lang == "en" else label.zh
    if lang == "en":
        return label
    first, *others = [label] if _chinese(label) else _APART.split(label)
    return "".join([_chinese(first), *(_chinese(part) or part for part in others)]) if _chinese(first) else label


def _chinese(part: str) -> str:
    numbers = iter(_NUMBER.findall(part))
    return re.sub("#", lambda _: next(numbers), CHINESE.get(_NUMBER.sub("#", part), ""))


_SENSORS = {"gyr": "陀螺仪", "acc": "加速度计", "mag": "磁力计"}

CHINESE: Final[dict[str, str]] = {
    **{f"{name} {axis}": f"{chinese} {axis}" for (name, chinese), axis in product(_SENSORS.items(), "xyz")},
    **{f"row {axis}": f"{axis} 行" for axis in "xyz"},
    # facts
    "device": "器件", "date": "日期", "made by": "软件", "recording": "记录文件", "record": "记录", "files": "文件",
    "model": "模型", "method": "方法", "residual": "残差", "data": "数据", "not covered": "未覆盖方向",
    "predicted": "预测误差", "reference": "参考", "temperature": "温度", "turned": "转角", "estimate": "估计",
    "scored": "计入统计", "left out": "未计入", "aligned": "已对齐", "searched": "搜索范围",
    "settling": "稳定时间", "declination": "磁偏角", "motion": "运动", "covariance": "协方差", "flagged": "标志",
    "before": "之前", "after": "之后", "calibration": "标定", "scenario": "场景", "sensors": "传感器",
    # evaluation
    "Attitude error": "姿态误差", "estimate against reference": "估计与参考之差", "Attitude errors": "姿态误差",
    "Errors of the scored samples": "计入样本的误差", "Samples": "样本", "samples": "样本数", "share": "占比",
    "meaning": "含义", "RMSE": "均方根误差", "rmse": "均方根", "mean": "均值", "std": "标准差", "max": "最大",
    "at": "时刻", "total": "总误差", "heading": "航向", "inclination": "倾角", "yaw": "偏航", "pitch": "俯仰",
    "roll": "横滚", "not scored": "未计入", "Error over time": "误差随时间变化", "Parameters": "参数", "value": "值",
    "Yaw, pitch and roll over time": "偏航、俯仰、横滚随时间变化", "time": "时间", "error": "误差",
    "Cumulative distribution of the error; dots mark #, # and # %": "误差累积分布；圆点为 #、#、# %",
    "Cumulative distribution of the total error": "总误差累积分布",
    "Cumulative distribution of the inclination error": "倾角误差累积分布", "cumulative share": "累积占比",
    "gyr-absent": "无陀螺仪值", "acc-absent": "无加速度计值", "mag-absent": "无磁力计值",
    "gyr-clipped": "陀螺仪饱和", "acc-clipped": "加速度计饱和", "mag-clipped": "磁力计饱和",
    "gyr-invalid": "陀螺仪值无效", "acc-invalid": "加速度计值无效", "mag-invalid": "磁力计值无效",
    "gap": "缺样", "time-fault": "时间错误", "acc-gated": "未用加速度计", "mag-gated": "未用磁力计",
    "gyr-held": "角速率保持", "not-converged": "未收敛", "gyr-stuck": "陀螺仪卡滞", "acc-stuck": "加速度计卡滞",
    "mag-stuck": "磁力计卡滞", "at-rest": "静止", "inconsistent": "传感器矛盾", "heading-free": "航向自由",
    "field-unknown": "地磁场未证实", "unit-suspect": "单元可疑", "unit-excluded": "单元已剔除",
    "cannot-isolate": "无法隔离",
    # certificate of calibration
    "Certificate of calibration": "标定证书", "Gyroscope": "陀螺仪", "Accelerometer": "加速度计",
    "Magnetometer": "磁力计", "GOOD": "良好", "FAIR": "中等", "POOR": "较差", "NOT GRADED": "未评级",
    "Mounting of the unit on its body": "在载体上的安装", "bias": "零偏", "matrix": "矩阵", "scale": "标度",
    "axes": "轴向", "not found": "未求得", "scale error": "标度因数误差", "axis misalignment": "安装误差",
    "non-orthogonality": "非正交误差", "g-sensitivity": "加速度灵敏度", "bias per K": "零偏温度系数（K）",
    "bias per K²": "零偏温度系数（K²）", "bias per K³": "零偏温度系数（K³）", "Directions covered": "覆盖方向",
    "seen": "已覆盖", "missing": "缺失", "Magnitude before and after calibration": "标定前后的模值",
    "magnitude": "模值", "expected": "期望值", "sample": "样本", "Bias over temperature": "零偏随温度变化",
    "change of bias": "零偏变化", "temperature of reference": "参考温度", "Residuals": "残差",
    "outliers": "离群点", "set aside": "已剔除",
    # static test
    "Static test": "静态测试", "Errors at rest": "静止误差", "# rests": "# 个静止位置",
    "max |e| before": "标定前最大", "max |e| after": "标定后最大", "rms before": "标定前均方根",
    "rms after": "标定后均方根", "Attitude of the reference": "参考姿态", "rest": "序号", "before yaw": "标定前偏航",
    "after yaw": "标定后偏航", "errors before and after calibration": "标定前后误差",
    "Errors at rest against the heading of the reference": "静止误差与参考航向", "yaw error": "偏航误差",
    "pitch error": "俯仰误差", "roll error": "横滚误差", "heading of the reference": "参考航向",
    # papers
    "Figure #": "图 #", "Fig #": "图 #", "Table #": "表 #", "seed": "随机种子", "none": "无", "range": "误差范围",
    "truth": "真值", "grid": "网格", "play": "播放", "This figure needs JavaScript.": "此图需要 JavaScript。",
    # noise
    "Noise data sheet": "噪声数据表", "Noise before and after": "前后噪声", "Q quantization": "Q 量化噪声",
    "N white noise": "N 白噪声", "B bias instability": "B 零偏不稳定性", "K random walk": "K 随机游走",
    "R ramp": "R 斜坡", "floor of the curve": "曲线最低处", "at an averaging time of": "对应平均时间",
    "standard deviation": "标准差", "not observable": "不可观测",
    "Allan deviation of all axes": "各轴艾伦偏差",
    "Allan deviation": "艾伦偏差", "model and terms": "模型与各项", "averaging time": "平均时间", "models": "模型",
    "masked on an axis": "某轴屏蔽", "masked": "屏蔽", "deviation": "偏差", "# % interval": "# % 置信区间",
    "# of # averaging times": "# / # 个平均时间",
    "terms": "各项", "read off at the dots": "在圆点处读取", "Allan deviation before and after": "前后艾伦偏差",
    "bent by the filter": "受滤波器影响", "Coefficients by method": "各方法的系数", "lines": "直线法",
    "least squares": "最小二乘", "likelihood": "最大似然", "Candidate models": "候选模型", "ΔBIC": "ΔBIC",
    "chosen": "选用", "oadev": "重叠艾伦偏差", "from": "下限", "to": "上限", "edf": "自由度",
    "IEEE Std #": "IEEE 标准 #", "noise": "噪声", "ratio": "比值", "ratio with its # % interval": "比值与 # % 区间",
    "quantization": "量化", "flicker of the integral": "积分闪烁", "white": "白噪声", "flicker": "闪烁",
    "random walk": "随机游走", "flicker walk": "闪烁游走", "random run": "随机加速",
    "Table # of Ou et al. #": "表 #（欧世星等，#）", "This record": "本记录",
    "As printed, and its errors recomputed for # samples at # Hz": "原表，误差按 # 个样本、# Hz 重新计算",
    "  its ± at T": "  对应 ± 与 T", "  likelihood": "  最大似然", "axis": "轴", "printed": "原值",
    "±/value": "相对误差", "implied T": "对应 T", "remark": "备注",
    # report of a recording
    "Attitude report": "姿态报告", "Recordings": "记录", "Tilt and heading": "倾斜与航向",
    "Roll and pitch": "横滚与俯仰",
    "Inclination from the vertical": "相对铅垂线的倾角", "Heading": "航向", "Roll": "横滚", "Pitch": "俯仰",
    "Share of time by heading": "各航向所占时间", "Share of time by heading, sectors of #°": "各航向所占时间（每 #°）",
    "mean vector": "平均矢量", "Attitude": "姿态", "Spectra": "频谱", "Power spectral density": "功率谱密度",
    "Power spectral density of roll and pitch": "横滚与俯仰的功率谱密度",
    "Power spectral density of the heading rate": "航向角速率的功率谱密度",
    "Power spectral density of the vertical acceleration": "垂向加速度的功率谱密度", "Bursts": "分段",
    "Sensors": "传感器",
    "Significant double amplitude by burst": "各段有效双幅值", "Inclination by burst": "各段倾角",
    "Angular rate": "角速率", "Specific force": "比力", "Magnetic flux density": "磁感应强度", "Temperature": "温度",
    "Estimated gyroscope bias": "陀螺零偏估计", "Claimed standard deviation": "滤波器给出的标准差",
    "claimed ± # sd": "滤波器给出的 ± # 倍标准差", "# sd": "# 倍标准差", "Gaps and flags": "缺样与标志",
    "Flags over time": "标志随时间变化", "Quality": "质量", "Quality flags by burst": "各段质量标志",
    "Tests and their thresholds": "检验及其门限", "Definitions": "定义", "Roll, pitch and heading": "横滚、俯仰与航向",
    "# further remarks": "另有 # 条说明", "show all": "显示全部",
    "Drag to zoom; double-click or Escape for all; arrow keys, + and − move":
        "拖动放大；双击或 Escape 显示全部；方向键、+、− 移动与缩放",
    "Calibration: NONE: these sensor values are uncalibrated. All numbers of this page are of uncalibrated values.":
        "标定：无。传感器数据未经标定，本页所有数值均基于未标定数据。",
    "SHA-256": "SHA-256", "session": "会话", "time (UTC)": "时间（UTC）", "duration": "时长", "rate": "采样率",
    "noise card": "噪声卡", "frame": "坐标系", "least": "最小", "greatest": "最大", "significant": "有效值",
    "largest": "最大双幅值", "waves": "波数", "limit": "限值", "beyond": "超限占比", "spread": "离散度",
    "resultant": "合矢量长", "sector about": "扇区中心", "count": "个数", "begin": "开始", "length": "长度",
    "time in gaps": "缺样时间", "gaps": "缺样", "heading rate": "航向角速率", "vertical acceleration": "垂向加速度",
    "vertical": "垂向加速度", "frequency": "频率", "UTC": "UTC",
    **{f"{name} {word}": f"{chinese}{meaning}" for (name, chinese), (word, meaning) in product(
        {"roll": "横滚", "pitch": "俯仰", "heading": "航向", "tilt": "倾角"}.items(),
        {"std": "标准差", "significant": "有效双幅值", "Tz": " Tz", "mean": "均值", "greatest": "最大值",
         "spread": "离散度"}.items())},
    **{f"{name} {axis}": f"{chinese} {axis}" for (name, chinese), axis in product(
        {"rate": "角速率", "force": "比力", "field": "磁场", "bias": "零偏"}.items(), "xyz")},
    # grade
    "Grade": "评级", "# of #": "#/#", "grade": "评级", "criterion": "准则", "points lost": "扣分",
    "at most": "最多扣分",
    "reason": "原因", "jitter": "抖动", "loss": "丢失", "clipping": "饱和", "stuck": "卡滞", "resolution": "分辨率",
    "plausibility": "合理性", "rest at the start": "起始静止",
    "clock": "时钟", "converged": "收敛", "jumps": "跳变", "uncertainty": "不确定度",
    # quality flags
    "gyr": "陀螺仪", "acc": "加速度计", "mag": "磁力计", "temp": "温度", "attitude": "姿态", "test": "检验",
    "looks at": "检验内容", "suspect (#)": "可疑（#）", "fail (#)": "不合格（#）", "pass": "通过", "suspect": "可疑",
    "fail": "不合格", "not evaluated": "未评估", "# pass": "# 通过", "# suspect": "# 可疑", "# fail": "# 不合格",
    "# missing": "# 缺失", "# not evaluated": "# 未评估", "percent good": "有效率", "spike": "尖峰",
    "rate of change": "变化率", "field": "磁场", "flat line": "恒定不变", "mean shift": "均值偏移",
    "acceleration": "加速度", "outside": "超出", "longest time without a usable value": "无可用数据的最长时间",
    "samples neither absent, clipped, invalid nor stuck; attitudes that are known and trusted":
        "未缺失、未饱和、有效且未卡滞的样本；已知且可信的姿态",
    "samples more than # standard deviations off the mean and off both neighbours":
        "偏离均值及前后样本均超过 # 倍标准差的样本",
    "steps of more than # standard deviations from sample to sample": "相邻样本之差超过 # 倍标准差",
    "samples at the end of the sensor's range or impossible; temperatures outside -# to # °C":
        "达到量程端或不可能的样本；超出 -# 至 # °C 的温度",
    "median of |mag| outside of the Earth's # to # µT": "|mag| 的中值超出地磁场 # 至 # µT",
    "all axes the same to the last bit, in # samples or more": "各轴连续 # 个以上样本逐位相同",
    "change of the mean from one eighth of a burst to the next over its standard deviation, in bursts of # s and more; "
    "of gyr, |acc|, |mag|, roll and pitch":
        "相邻八分之一段均值之差与标准差之比，限 # s 以上的段；gyr、|acc|、|mag|、横滚与俯仰",
    "samples whose vertical acceleration is beyond # g": "垂向加速度超过 # g 的样本",
}  # fmt: skip
