"""Files that are spoiled are seen: each by a check that a sound file passes."""

import pytest

from benchmarks.print_checks.filling import amount, feeding, places, volume
from benchmarks.print_checks.motion import bed, speeds, support, travel
from benchmarks.print_checks.tooling import changes, cuts, heat, words

SHIFTED = {"gcode": {"offset": [18.0, -2.0, 0.0], "offset_by": "gcode"}}
MUTANTS = {
    "matrix by a twentieth too much": (volume, lambda text: more(text, 1.05)),
    "the first wait for fibre": (heat, lambda text: text.replace("M109 T1 S250\n", "", 1)),
    "the first standby of matrix": (heat, lambda text: text.replace("M104 T0 S100\n", "", 1)),
    "a cut 1 mm early": (cuts, {"cutter_distance": 43.0, "minimum_length": 43.0}),
    "no more than the tail fed": (feeding, {"process": {"restart_extra": 0.0}}),
    "travel .1 mm low": (travel, {"gcode": {"lift": 0.9}, "process": {"strand_lift": 0.0}}),
    "twice the speed at the start": (speeds, {"process": {"start_speed": 4.0}}),
    "corners at any speed": (speeds, {"process": {"corner_length": 0.0}}),
    "tails at any speed": (speeds, {"process": {"finish_speed": 9.0}, "fibre_speed": 5.5}),
    "the offset of the nozzles left out": (places, {"gcode": {"offset_by": "firmware"}}),
    "a short strand lost": (amount, {"process": {"short": "drop"}}),
    "no priming": (changes, {"process": {"prime": "none"}}),
    "4 mm of lift at changes": (changes, {"process": {"tool_lift": 4.0}}),
    "a bed too small": (bed, lambda text: text.replace("G0 X", "G0 X-")),
    "a word of another firmware": (words, lambda text: text.replace("M280", "M340")),
    "half a strand in the air": (support, lambda text: text.replace("Z0.754", "Z1.154")),
}


def more(text, factor):
    """Feed more by all lines of matrix, nothing else."""
    found, tool = [], ""
    for line in text.splitlines():
        tool = line if line in ("T0", "T1") else tool
        words = line.split(" E")
        if tool == "T0" and line.startswith("G1 ") and " E" in line and "X" in line:
            fed, _, rest = words[1].partition(" ")
            line = f"{words[0]} E{factor * float(fed):.5f} {rest}"
        found.append(line)
    return "\n".join(found)


@pytest.fixture(scope="module")
def sound(small_part):
    """A print whose firmware does not know the offset of the nozzles."""
    return small_part("marlin_two_tools", SHIFTED)


@pytest.mark.parametrize("name", MUTANTS)
def test_a_spoiled_file_is_seen(sound, small_part, name):
    check, spoil = MUTANTS[name]
    assert check(sound, sound.done) == []
    if isinstance(spoil, dict):
        table = {**SHIFTED, **spoil}
        table["gcode"] = {**SHIFTED["gcode"], **spoil.get("gcode", {})}
        text = small_part("marlin_two_tools", table).text
    else:
        text = spoil(sound.text)
    assert text != sound.text
    assert check(sound, sound.run(text)) != []
