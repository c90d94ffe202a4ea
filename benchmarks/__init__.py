"""What the library costs, beside others that do the same work to the same error: ``python -m benchmarks``.

Each module named here has ``cases(quick)``, which yields `Case` after `Case`; the command runs it in a process of its
own, on one core unless it says otherwise, and makes the tables and figures of ``docs/performance.md`` from what it
measures.
"""

from typing import NamedTuple


class Benchmark(NamedTuple):
    """A module of cases.

    Attributes
    ----------
    module : str
        Its name in this package.
    about : str
        What is measured, beside what.
    one_core : bool
        Whether its process is kept to one core and one thread.
    """

    module: str
    about: str
    one_core: bool = True


BENCHMARKS = {
    "four-bar": Benchmark("four_bar", "Four-bar to jounce, beside CasADi and SymPy"),
    "rsur": Benchmark("rsur", "RSUR mechanism to jounce, beside the bare LAPACK factorization and solves it needs"),
    "written-c": Benchmark("written_c", "Equations of the RSUR as C, beside CasADi's C from the same residual"),
    "bodies": Benchmark("bodies", "Chains of four-bars against the number of bodies, beside banded LAPACK"),
    "orders": Benchmark("orders", "Cost of each further derivative, beside nested automatic differentiation"),
    "reactions": Benchmark("reactions", "Driver torque and two rates, beside NumPy with differenced multipliers"),
    "arm": Benchmark("arm", "Torque of an arm with two rates, beside CasADi, Pinocchio and MuJoCo"),
    "forward": Benchmark("forward", "Accelerations of an arm from torques, beside Pinocchio and MuJoCo"),
    "feedforward": Benchmark("feedforward", "Motor torques behind springs, beside differences of Pinocchio's torques"),
    "inverse-kinematics": Benchmark("inverse_kinematics", "Coordinates of an arm for poses, beside Pinocchio"),
    "retiming": Benchmark("retiming", "Paths of an arm retimed within limits, beside TOPP-RA"),
    "joints": Benchmark("joints", "Torque with two rates against the number of joints"),
    "frames": Benchmark("frames", "Hand, Jacobian and energy of an arm, beside Pinocchio; splines beside SciPy"),
    "pendulum": Benchmark("pendulum", "Double pendulum: time against error, beside SciPy, diffrax, heyoka and Exudyn"),
    "pendulums": Benchmark("pendulums", "Chains of pendulums, simulated, beside equations written by hand"),
    "batch": Benchmark("batch", "A thousand double pendulums side by side, beside one alone and diffrax"),
    "gradients": Benchmark("gradients", "A reverse gradient beside the solution that it is of; families beside loops"),
    "jerk": Benchmark("jerk", "What jerk is worth: integration with it and without it at the same steps"),
    "files": Benchmark("files", "Reading files, beside ruamel.yaml, Pinocchio and MuJoCo"),
    "view": Benchmark("view", "From a slider of the web view to a new motion", one_core=False),
    "start": Benchmark("start", "Start-up of the command and the import, beside JAX", one_core=False),
    "first-use": Benchmark("first_use", "Commands in fresh processes, without and with a cache", one_core=False),
    "first-calls": Benchmark(
        "first_calls", "First calls in new processes of Python, beside the import", one_core=False
    ),
    "sweep": Benchmark("sweep", "A sweep: what Dask adds, the whole time, and the memory", one_core=False),
    "memory": Benchmark("memory", "Peak memory of a long grid, beside its outputs", one_core=False),
    "cores": Benchmark("cores", "All cores beside one, and two threads", one_core=False),
    "gpu": Benchmark("gpu", "A CUDA device beside the cores of its machine", one_core=False),
}
