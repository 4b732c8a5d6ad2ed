"""Tables of the terminal keep their figures whole."""

from rich.console import Console

from trainer.tables import terminal_table

HEADER = ("parameter", "R2", "ceiling", "accuracy paper")
ROWS = [("one.of.them", "0.123 [-1.23, 4.56]", "0.999", "0.876"), ("mean", "0.1", "0.9", "")]


def test_the_last_columns_are_named_below_where_there_is_no_room_for_them(capsys):
    for width, said, left_out in ((100, "0.876", "lack of width"), (45, "alone: accuracy paper", "0.876")):
        Console(width=width, force_terminal=False).print(terminal_table("t", HEADER, ROWS, width=width))
        text = " ".join(capsys.readouterr().out.split())
        assert said in text and left_out not in text
        assert "0.123 [-1.23, 4.56]" in text and "…" not in text
