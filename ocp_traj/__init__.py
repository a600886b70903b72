"""Robot trajectory optimisation whose every trajectory is optimal and provably legal."""

import os
from pathlib import Path

# Threads change the order in which BLAS sums, and with it the last bits of a result: one thread makes a run repeatable
# bit by bit. OpenBLAS reads this when it is loaded, so it stands before every import of NumPy, SciPy and CasADi (where
# the caller has imported them already it comes too late); a value the user has set is kept.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# In a checkout `problems/` and `solvers/` lie beside this package, not in it, and from the repository root this package
# hides an installed one: without these lines `import ocp_traj.problems` fails there after a plain install.
_checkout = Path(__file__).resolve().parent.parent
if (_checkout / "pyproject.toml").is_file() and (_checkout / "problems" / "__init__.py").is_file():
    __path__.append(str(_checkout))

__version__ = "0.1.0"

# --- public names, imported on first use ---
