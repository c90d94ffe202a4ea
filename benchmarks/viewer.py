"""How long the web view takes from a slider to a new motion: solving, arrows and paths, without the browser.

Run on an idle core: python benchmarks/viewer.py
"""

import time

import numpy as np

import jounce as jn
from jounce.viewer.local_server import quiet_server
from jounce.viewer.mechanisms import MechanismSubject
from jounce.viewer.page import Page

AIM, TRIES = 50.0, 40  # ms


def main() -> None:
    for file in ("four_bar", "slider_crank", "six_bar_watt", "press", "rssr", "rsur"):
        subject = MechanismSubject(jn.load(f"examples/{file}.yaml"))
        page = Page(quiet_server(), subject, order=4)
        try:
            name, value = next((p.name, p.value) for p in subject.parameters if not p.derived)
            taken = []
            for k in range(TRIES):
                started = time.perf_counter()
                page.session.request({name: value * (1 + 1e-3 * np.sin(k))})
                page.session.wait()
                taken.append(1e3 * (time.perf_counter() - started))
            if page.session.error is not None:
                raise page.session.error
            middle, worst = np.median(taken[5:]), np.max(taken[5:])
            aim = f", aim {AIM:.0f} ms" if file == "four_bar" else ""
            print(f"{file}: {len(page.recording.time)} instants, {middle:.1f} ms, worst {worst:.1f} ms{aim}")
        finally:
            page.close()


if __name__ == "__main__":
    main()
