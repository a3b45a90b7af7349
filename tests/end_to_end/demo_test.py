"""The README's first command, and the scorecard that it promises."""

import json
import pathlib
import tempfile
import unittest

from programs import ROOT, run


class Demo(unittest.TestCase):
    def test_two_days_of_a_street_become_a_clean_and_current_map(self):
        with tempfile.TemporaryDirectory() as out:
            out = pathlib.Path(out)
            demo = run(ROOT / "deploy/demo", "--out", out)
            card = json.loads((out / "scorecard.json").read_text())
            print("scorecard:", json.dumps(card))
            self.assertIn("day_2:", demo.stdout)
            for day in ("day-1.png", "day-2.png"):
                self.assertTrue((out / day).read_bytes().startswith(b"\x89PNG"))
            self.assertGreaterEqual(card["day_2"]["SA"], 98)
            self.assertGreaterEqual(card["day_2"]["DA"], 98)
            self.assertGreaterEqual(card["day_2"]["SA_facades"], 99)
            self.assertGreaterEqual(card["day_2"]["SA_ground"], 99)
            cars = card["parked_cars"]
            self.assertGreaterEqual(cars["left"], 3, "too few cars left to tell anything")
            self.assertGreaterEqual(cars["left_and_gone"], 0.9 * cars["left"])
            self.assertGreaterEqual(cars["came_and_there"], 0.9 * cars["came"])
            self.assertLess(card["alignment"]["metres_rms"], 0.1)
            self.assertLess(card["alignment"]["degrees_rms"], 0.2)


if __name__ == "__main__":
    unittest.main(verbosity=2)
