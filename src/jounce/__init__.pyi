"""What the package offers, and from where: the list that `__init__.py` imports when it is first needed.

`from jounce import *` leaves out what comes from ".", whose names are those of others too, such as `io`.
"""

from jounce import (
    cams as cams,
    energy as energy,
    errors as errors,
    forces as forces,
    joints as joints,
    laws as laws,
    outputs as outputs,
    planning as planning,
    robot as robot,
)
from jounce.constraints import (
    drivers as drivers,
    planar as planar,
    spatial as spatial,
)
from jounce.design import (
    optimize as optimize,
    tolerance as tolerance,
)
from jounce.dynamics import (
    check_limits as check_limits,
    constraint_equations as constraint_equations,
    driver_force as driver_force,
    equilibrium as equilibrium,
    joint_reaction as joint_reaction,
    linearize as linearize,
)
from jounce.errors import (
    JounceError as JounceError,
)
from jounce.execution.store.programs import (
    keep_programs as keep_programs,
)
from jounce.integrate import (
    Event as Event,
    Obreshkov as Obreshkov,
    Taylor as Taylor,
    simulate as simulate,
    simulate_batch as simulate_batch,
)
from jounce.io import (
    load as load,
    load_robot as load_robot,
    load_trajectory as load_trajectory,
    write_mechanism as write_mechanism,
)
from jounce.jet import (
    Jet as Jet,
)
from jounce.kinematics import (
    Motion as Motion,
    Status as Status,
    assemblies as assemblies,
    mobility as mobility,
    solve as solve,
    solve_batch as solve_batch,
    trace as trace,
)
from jounce.mechanism import (
    Body as Body,
    Mechanism as Mechanism,
    TimeGrid as TimeGrid,
)
from jounce.planning import (
    inverse_kinematics as inverse_kinematics,
    retime as retime,
    smooth as smooth,
)
from jounce.robot import (
    Inertia as Inertia,
    Joint as Joint,
    Limits as Limits,
    Link as Link,
    Robot as Robot,
    bias_forces as bias_forces,
    forward_dynamics as forward_dynamics,
    forward_kinematics as forward_kinematics,
    inverse_dynamics as inverse_dynamics,
    jacobian as jacobian,
    mass_matrix as mass_matrix,
)
from jounce.sweeps import (
    sweep as sweep,
)
from jounce.trajectory import (
    JointTrajectory as JointTrajectory,
)
from jounce.written_equations import equations as equations

from . import (
    design as design,
    dynamics as dynamics,
    integrate as integrate,
    io as io,
    jet as jet,
    kinematics as kinematics,
    papers as papers,
    plot as plot,
    progress as progress,
    rigid as rigid,
    testing as testing,
    trajectory as trajectory,
    viewer as viewer,
)

__version__: str
