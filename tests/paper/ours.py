"""What this code says to each quoted number of the paper: the expressions printed in docs/paper.md.

One function for each entry of items.toml that has a number here, named by its id; its body is the
Python line of the page, and the names above the functions are those that the page sets first.
"""

import amoeboid as am
from amoeboid.closed_forms.dimensionless import dimensionless, viscosity_ratio
from amoeboid.closed_forms.monomers import ExponentialDecay, monomer_ratio, speed_coefficients
from amoeboid.closed_forms.phase_boundary import phase_boundary
from amoeboid.closed_forms.points import infinite_pressure
from amoeboid.config import Config, figure_3d, resolved
from amoeboid.model.units import magnitude

p = am.Parameters()
p3d = figure_3d()
cell = am.Parameters.physical()
rigid = infinite_pressure(cell)
stiff = am.Parameters.physical(alpha="300 Pa * 190 nm / (1370 / um^2)")
mu = magnitude("8.5 umol/l", "1/um^3")
fit = ExponentialDecay(
    B=magnitude("1.184 um/min", "um/s"),
    C=magnitude("1.248 / hour", "1/s"),
    mu_0=magnitude("3 umol/l", "1/um^3"),
)


def fig3A_D():
    return p.D


def fig3A_type():
    return am.theory(p).bifurcation


def fig3A_threshold():
    return am.theory(p).threshold


def fig3A_agreement():
    return 100 * (
        am.prediction(infinite_pressure(p)).max_retrograde_speed_at_v_p0
        / am.steady_states(p).fastest_stable.max_retrograde_speed
        - 1
    )


def fig3B_D():
    return p3d.D


def fig3B_type():
    return am.theory(p3d).bifurcation


def fig3B_threshold():
    return am.theory(p3d).threshold


def fig3B_fold():
    return am.branch(p3d, "v_p0", 5, 6.2).folds[0].value


def fig3B_branches():
    return sum(state.stable for state in am.steady_states(p3d.replace(v_p0=5.5)))


def fig3C_boundary():
    return phase_boundary(infinite_pressure(p), [3.0]).D[0]


def fig3C_boundary_300():
    return phase_boundary(p, [3.0]).D[0]


def fig3D_D():
    return p3d.D


def fig3D_v_p0():
    return p3d.v_p0


def fig3D_speed():
    return am.steady_states(p3d).fastest_stable.max_retrograde_speed


def fig3D_speed_3D():
    return am.simulate(p3d, mesh=am.Icosphere(3), progress=False).final.max_retrograde_speed


def fig3D_rear():
    return am.steady_states(p3d).fastest_stable.c_rear


def fig3D_deformation():
    return 100 * am.steady_states(p3d).fastest_stable.deformation


def main_ratio_vitro():
    return monomer_ratio(fit.mu_0, 0.19, 560.0)


def main_c_vivo():
    return cell.quantities()["c0"]


def main_ratio_vivo():
    return monomer_ratio(mu, 0.19, 1370.0)


def nodes():
    return 10 * 4 ** am.Mesh().subdivisions + 2


def start_high():
    return resolved(Config()).initial.perturbation


def ratio():
    return viscosity_ratio(p)


def sim_R0():
    return p.R0


def sim_delta_P():
    return p.delta_P


def sim_eta_s():
    return p.eta_s


def sim_eta_b():
    return p.eta_b


def sim_c0():
    return p.c0


def sim_c_r():
    return p.c_r


def sim_beta():
    return p.beta


def sim_D():
    return p.D


def sim_v_p0():
    return p.v_p0


def bar_c0():
    return dimensionless(p).c0


def bar_D():
    return dimensionless(p).D


def bar_eta():
    return viscosity_ratio(p)


def bar_v_p0():
    return dimensionless(p).v_p


def phys_R0():
    return cell.quantities()["R0"]


def phys_delta_P():
    return cell.quantities()["delta_P"]


def phys_eta_s():
    return cell.quantities()["eta_s"]


def phys_eta_b():
    return cell.quantities()["eta_b"]


def phys_c0():
    return cell.quantities()["c0"]


def phys_c_r():
    return cell.quantities()["c_r"]


def phys_beta():
    return cell.quantities()["beta"]


def phys_D():
    return cell.quantities()["D"]


def phys_v_p0():
    return cell.quantities()["v_p0"]


def flow_R0():
    return cell.quantities()["R0"]


def flow_eta():
    return cell.quantities()["eta_s"]


def flow_beta():
    return cell.quantities()["beta"]


def flow_D():
    return cell.quantities()["D"]


def flow_c0():
    return cell.quantities()["c0"]


def flow_c_r():
    return cell.quantities()["c_r"]


def flow_type():
    return am.theory(cell).bifurcation_infinite_pressure


def flow_threshold():
    return am.theory(cell).threshold


def flow_v_p0():
    return cell.quantities()["v_p0"]


def flow_speed():
    return cell.quantity(am.prediction(rigid).max_retrograde_speed, "L/T")


def flow_speed_v_p0():
    return cell.quantity(am.prediction(rigid).max_retrograde_speed_at_v_p0, "L/T")


def flow_speed_300():
    return am.theory(cell).max_retrograde_speed


def flow_speed_exact():
    return am.steady_states(cell).fastest_stable.max_retrograde_speed


def fit_B():
    return 60 * fit.B


def fit_C():
    return 3600 * fit.C


def fit_mu():
    return fit.mu_0 / magnitude("1 umol/l", "1/um^3")


def density():
    return 6700 / 12


def V_0():
    return speed_coefficients(fit, 0.19, 560.0)[0]


def V_1():
    return 1e3 * speed_coefficients(fit, 0.19, 560.0)[1]


def ratio_vitro():
    return monomer_ratio(fit.mu_0, 0.19, 560.0)


def c_vivo():
    return cell.quantities()["c0"]


def ratio_vivo():
    return monomer_ratio(mu, 0.19, 1370.0)


def beta0_one():
    return p.beta


def beta0_type():
    return am.theory(p.replace(beta=0.0)).bifurcation


def beta0_threshold():
    return am.theory(p.replace(beta=0.0)).threshold


def alpha():
    return magnitude("300 Pa * 190 nm / (1370 / um^2)", "Pa m^3")


def alpha_threshold():
    return am.theory(stiff).threshold


def alpha_increase():
    return 100 * (am.theory(stiff).threshold / am.theory(cell).threshold - 1)


def inverse_type():
    return am.theory(p.replace(law="inverse")).bifurcation


def inverse_threshold():
    return am.theory(p.replace(law="inverse")).threshold


def inverse_exponential():
    return am.theory(p).threshold
