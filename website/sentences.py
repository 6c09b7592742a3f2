"""Every sentence that the program says, once: findings by their codes, errors by the file that raises them."""

import ast
from collections.abc import Iterator
from pathlib import Path

from plumbob.core.findings import words

PACKAGE = Path(__file__).parents[1] / "src" / "plumbob"
FEWEST = 3
"""Words of a sentence; shorter texts are names."""


def template(node: ast.expr) -> str:
    """Text of an expression, with each value in it as its source; empty where it is no text."""
    if isinstance(node, ast.Constant):
        return node.value if isinstance(node.value, str) else ""
    if isinstance(node, ast.JoinedStr):
        return "".join(template(part) for part in node.values)
    if isinstance(node, ast.FormattedValue):
        return f"{{{ast.unparse(node.value)}}}"
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add):
        return template(node.left) + template(node.right)
    return ""


def errors(tree: ast.Module) -> Iterator[str]:
    """Sentences of the errors that a file raises."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Raise) and isinstance(node.exc, ast.Call):
            for part in node.exc.args:
                if len((text := template(part)).split()) >= FEWEST:
                    yield " ".join(text.split())


def page() -> str:
    """The sentences, as the tests keep them."""
    chinese = words("zh")
    lines = ["Every sentence that the program says, made by website/sentences.py. Findings in English and Chinese:", ""]
    for code, sentence in sorted(words("en").items()):
        lines += [code, f"  {sentence}", f"  {chinese[code]}"]
    lines += ["", "Errors, by the file that raises them:"]
    for file in sorted(PACKAGE.rglob("*.py")):
        if sentences := dict.fromkeys(errors(ast.parse(file.read_text(encoding="utf-8")))):
            lines += ["", file.relative_to(PACKAGE).as_posix(), *(f"  {sentence}" for sentence in sentences)]
    return "\n".join([*lines, ""])


if __name__ == "__main__":
    print(page(), end="")
