"""Tables for a paper: LaTeX's `tabular` under the rules of the package `booktabs`."""

import re

from bug_gym.evaluation.text_table import TextTable

SIGNS = {
    **{sign: "\\" + sign for sign in "#$%&_{}"},
    "\\": r"\textbackslash{}",
    "^": r"\textasciicircum{}",
    "~": r"\textasciitilde{}",
    "<": r"\textless{}",
    ">": r"\textgreater{}",
    "|": r"\textbar{}",
    '"': r'\texttt{"}',  # fonts of old have it among those of typewriters alone
}
"""What LaTeX, or a font of it, would take for something else, and how it is written."""

_SIGN = re.compile("|".join(map(re.escape, SIGNS)))
_LIGATURE = re.compile("(?<=[-'`,?!])(?=[-'`,])")
"""Between two characters that it would set as one, such as a long dash."""
_MINUS = re.compile(r"(?<![^\s[])-(?=\d)")
"""Before a number, where a hyphen would be too short."""


def latex_table(table: TextTable) -> str:
    r"""A floating table with its caption, to be copied or `\input` where `\usepackage{booktabs}` stands.

    Its first column is set flush left, the others, which hold numbers, flush right.
    """
    rows = [" & ".join(map(latex_text, cells)) + r" \\" for cells in (table.header, *table.lines)]
    body = [r"\toprule", rows[0], r"\midrule", *map(_begun, rows[1:]), r"\bottomrule"]
    return "\n".join(
        [
            r"\begin{table}",
            r"\centering",
            rf"\caption{{{latex_text(table.title)}}}",
            rf"\begin{{tabular}}{{l{'r' * (len(table.header) - 1)}}}",
            *body,
            r"\end{tabular}",
            r"\end{table}",
        ]
    )


def latex_text(text: str) -> str:
    """A text that LaTeX sets as it is, in one line."""
    written = _SIGN.sub(lambda sign: SIGNS[sign[0]], " ".join(text.splitlines()))
    return _MINUS.sub("$-$", _LIGATURE.sub("{}", written))


def _begun(row: str) -> str:
    """A row that the end of the one before doesn't take for its options, which begin with * or [."""
    return "{}" + row if row.startswith(("[", "*")) else row
