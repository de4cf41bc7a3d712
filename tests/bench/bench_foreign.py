"""Ten arithmetics outside the family, searched on either instruction: none may be named, the law itself must be.

Run it as a program: `python tests/bench/bench_foreign.py [EXECUTIONS] [SEED]`. It prints a line for each and ends
with 1 unless no dialect fits each foreign one, the first execution shown that none explains, and the law is named.
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent.parent))

from lockstep.dialect_traces import loop_of, trace
from lockstep.test_identify_foreign import FOREIGN

from ahgateway.cli.compiled_laws import keep_compiled
from ahgateway.core.controllers import CONTROLLERS
from ahgateway.core.dialect import DEFAULT
from ahgateway.lockstep.identify import identify


def main() -> int:
    executions, seed = (int(text) for text in (sys.argv[1:] + ["150", "5"][len(sys.argv) - 1 :]))
    keep_compiled()
    wrong = 0
    for name in ("DPID", "DPIDE"):
        for foreign, make in {"the law": None, **FOREIGN}.items():
            step = None if make is None else make(CONTROLLERS[name].step)
            found = identify(loop_of(name), trace(name, DEFAULT, seed, executions, step))
            wrong += not (found.is_named if make is None else found.unexplained)
            where = "" if found.unexplained is None else f", first not explained {found.unexplained.number}"
            left = "undecided" if found.is_crowded or found.is_cut else "none fits"
            sys.stdout.write(f"{name}, {foreign}: {'named' if found.is_named else left}{where}\n")
            sys.stdout.flush()
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main())
