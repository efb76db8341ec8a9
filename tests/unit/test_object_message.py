"""Messages that name many objects: short in a window, complete in the report."""

from engine.object_message import ObjectMessage, counted, first_line, listing, object_message, objects_of
from engine.worker.messages import PackedMessage, read

NAMES = [f"Bob's chair.{number:03d}" for number in range(67)]


def test_few_names_are_all_in_the_sentence():
    assert object_message("Objects {} are dark: {}.", ["A", "B, {}"]) == "Objects 'A', 'B, {}' are dark: {}."


def test_of_many_names_the_first_line_has_some_and_the_second_all():
    message = object_message("Objects {} are left out.", NAMES)
    short, everything = message.split("\n")
    assert first_line(message) == short and len(short) < 150
    assert "and 62 more are left out." in short
    assert everything.startswith("All 67: ") and all(f"'{name}'" in everything for name in NAMES)


def test_sentence_knows_the_objects_that_it_is_about():
    assert objects_of(object_message("Objects {} are left out.", NAMES)) == tuple(NAMES)
    assert objects_of(listing("Materials {} are grey.", ["A"])) == objects_of("Nothing.") == ()


def test_sentence_keeps_its_objects_on_the_way_from_the_worker():
    notes = (ObjectMessage("'A' is dark.", ("A",)), "Nothing.")
    parcel = PackedMessage({"warnings": notes})
    memory = bytearray(parcel.size)
    parcel.write(memoryview(memory))
    arrived = read(memoryview(memory))["warnings"]
    assert arrived == notes and [objects_of(note) for note in arrived] == [("A",), ()]


def test_what_is_counted_is_one_or_many():
    assert (counted(1, "patch", "es"), counted(0, "object"), counted(1021, "patch", "es")) == (
        "1 patch",
        "0 objects",
        "1,021 patches",
    )
