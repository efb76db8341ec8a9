"""Messages that name many objects: short in a window, complete in the report."""

from engine.naming import first_line, naming

NAMES = [f"Bob's chair.{number:03d}" for number in range(67)]


def test_few_names_are_all_in_the_sentence():
    assert naming("Objects {} are dark: {}.", ["A", "B, {}"]) == "Objects 'A', 'B, {}' are dark: {}."


def test_of_many_names_the_first_line_has_some_and_the_second_all():
    message = naming("Objects {} are left out.", NAMES)
    short, everything = message.split("\n")
    assert first_line(message) == short and len(short) < 150
    assert "and 62 more are left out." in short
    assert everything.startswith("All 67: ") and all(f"'{name}'" in everything for name in NAMES)
