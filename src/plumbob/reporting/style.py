"""What pages and pictures share: colours, languages, and their labels in Chinese, in the terms of papers in Chinese."""

import re
from itertools import product
from typing import Final

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


def said(label: str, lang: str) -> str:
    """A label in a language; what is not a label stays as it is.

    Parts of a label that stand apart by a colon, a comma or a unit in brackets are looked up one by one, where the
    first of them is known; a number in it stands as # in the dictionary.
    """
    if lang == "en":
        return label
    first, *others = [label] if _known(label) else _APART.split(label)
    return "".join([_known(first), *(_known(part) or part for part in others)]) if _known(first) else label


def _known(part: str) -> str:
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
    # teaching-arm paper
    "Teaching-arm paper at rest": "示教机械臂论文：静态", "Teaching-arm paper in the turn": "示教机械臂论文：动态",
    "Figure #": "图 #", "Table #": "表 #", "attitude error at rest": "静态姿态角误差", "seed": "随机种子",
    "attitude error in the turn": "动态姿态角误差", "heading in the turn": "航向角变化曲线",
    "one set without a regulator": "单组无调节", "one set with a PI law": "单组 PI 调节",
    "fuzzy-PI on two sets": "两组模糊 PI 组合调节", "attitude errors": "姿态角误差", "none": "无调节", "PI": "PI 调节",
    "fuzzy-PI": "模糊 PI", "PI on both sets": "两组 PI 调节", "range": "误差范围", "std in the paper": "论文标准差",
    "truth": "真值",
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
}  # fmt: skip
