//! The parameters of a `droplet` scene.

use crate::formulas::{FormulaList, FormulaLists, NamedNumbers, constants};
use crate::scenes::pcp_spec::PcpSpec;
use crate::scenes::shapes::Shape;
use crate::spec::choice::with_defaults;
use crate::spec::{Coordinates, Interval, Items, Listed, NOT_NEGATIVE, POSITIVE, whole};

crate::words! {
    /// What starts.
    pub enum CaseName {
        /// an ellipse at rest
        Oscillating = "oscillating",
        /// a circle that a force tears apart
        Dividing = "dividing",
        /// a circle at rest
        Static = "static",
        /// any shape
        Custom = "custom",
    }
}

crate::words! {
    /// How a fluid moves along a wall.
    pub enum WallWord {
        /// with the wall
        NoSlip = "no_slip",
        /// freely
        FreeSlip = "free_slip",
    }
}

crate::group! {
    /// A wall.
    pub struct WallSpec: Default {
        /// whether the fluid moves with the wall or slips along it
        slip as "type": WallWord = WallWord::NoSlip;
        /// velocity of the wall, along itself; 0 when not given
        velocity: Option<Coordinates>;
        /// angle in degrees at which the interface meets the wall, measured in the drop; 90 when not given
        contact_angle: Option<f64>, in Interval::at_least(0.0).and_at_most(180.0);
        /// angle in degrees above which the contact line advances, with receding_angle in place of contact_angle
        advancing_angle: Option<f64>, in Interval::at_least(0.0).and_at_most(180.0);
        /// angle in degrees below which the contact line recedes
        receding_angle: Option<f64>, in Interval::at_least(0.0).and_at_most(180.0);
    }
}

crate::choice! {
    /// What the box is like along an axis.
    pub enum AxisSpec untagged "walls" {
        /// what leaves at one end comes in at the other
        Periodic = "periodic",
        /// a wall at each end
        Walls = "walls" {
            /// wall at the lower end
            low: WallSpec = WallSpec::default();
            /// wall at the upper end
            high: WallSpec = WallSpec::default();
        },
        /// a box in shear: its images slide past each other along x, so that the fluids flow on an average as the rate times the
        /// distance from the middle
        LeesEdwards = "lees_edwards" {
            /// shear rate γ
            shear_rate: f64;
        }
    }
}

crate::group! {
    /// The box.
    pub struct BoxSpec {
        /// lower corner
        low: Coordinates;
        /// upper corner
        high: Coordinates;
        /// what the box is like along each axis; periodic when not given
        axes: Option<Listed<AxisSpec>>, in Items(2, 3, ());
    }
}

/// Bodies of a scene at most.
pub const MOST_OBSTACLES: usize = 16;

crate::group! {
    /// A body that stands in the fluids.
    pub struct ObstacleSpec {
        /// the body: a shape that is known exactly, or a mesh
        shape: Shape;
        /// its surface
        wall: WallSpec = WallSpec::default();
    }
}

crate::group! {
    /// A fluid.
    pub struct FluidSpec: Default {
        /// density ρ₀ at rest
        density: f64 = 1.0, in POSITIVE;
        /// dynamic viscosity η
        viscosity: f64 = 0.5, in NOT_NEGATIVE;
        /// speed of sound c, at least ten times the largest speed to come
        sound_speed: f64 = 100.0, in POSITIVE;
        /// exponent γ of the equation of state
        polytropic: f64 = 7.0, in Interval::at_least(1.0).and_at_most(20.0);
    }
}

crate::group! {
    /// The two fluids.
    pub struct Fluids: Default {
        /// the drop
        inside: FluidSpec = FluidSpec::default();
        /// the fluid around the drop
        outside: FluidSpec = FluidSpec::default();
    }
}

crate::words! {
    /// The force of surface tension.
    pub enum TensionWord {
        /// −(τ/ρ)(κ − κ₀) n δ with the curvature κ₀ of a ball for each droplet, without the sum over each droplet
        Balanced = "balanced",
        /// the balanced force of version 0.1, with its volumes, pressures, redistancing and lattice, for comparison
        Balanced01 = "balanced_0_1",
        /// κ₀ = 0 (the paper)
        Csf = "csf",
    }
}

crate::words! {
    /// The lattice of the particles at the start.
    pub enum LatticeWord {
        /// squares, cubes in space
        Cubic = "cubic",
        /// equilateral triangles, in the plane alone
        Hexagonal = "hexagonal",
        /// cubes with a particle in each center, in space alone
        BodyCentered = "body_centered",
        /// cubes with a particle in each face, in space alone
        FaceCentered = "face_centered",
    }
}

crate::words! {
    /// How volumes follow from sums of kernels, V = a/Σ W.
    pub enum VolumesWord {
        /// a such that the volumes of the start fill the box: a lattice at rest has no pressure
        Calibrated = "calibrated",
        /// a = 1 (the paper)
        Plain = "plain",
    }
}

crate::choice! {
    /// What becomes of the level that particles carry when closest points are found.
    pub enum RedistancingChoice {
        /// long waves of the interface move with the particles alone; short waves and slopes are repaired
        Transparent = "transparent" {
            /// share of a deviation that is repaired in the time ½ √(ρh³/(2πτ)), about a step; .05 for case static, .02
            /// for case oscillating, else .1, when not given
            relaxation: Option<f64>, in POSITIVE.and_at_most(1.0);
            /// radius of the surface filter in h
            radius_h: f64 = 6.0, in Interval::at_least(2.0).and_at_most(20.0);
        }
        /// the signed distance replaces the level at every evaluation (the paper)
        Overwrite = "overwrite",
    }
}

crate::words! {
    /// How the tension follows from the covered share x of the interface.
    pub enum EquationWord {
        /// τ₀ (1 − βx)
        Linear = "linear",
        /// τ₀ (1 + β ln(1 − x))
        Langmuir = "langmuir",
    }
}

/// Largest coverage at the start.
pub const MOST_COVERAGE: f64 = 0.95;

crate::group! {
    /// An insoluble surfactant on the interface.
    pub struct SurfactantSpec {
        /// share of the interface that is covered at the start
        coverage: f64 = 0.3, in Interval::at_least(0.0).and_at_most(MOST_COVERAGE);
        /// change of the coverage at the start by length, from the middle of the box; 0 when not given
        slope: Option<Coordinates>;
        /// how the tension follows from the coverage
        equation: EquationWord = EquationWord::Langmuir;
        /// elasticity β
        elasticity: f64 = 0.2, in POSITIVE.and_at_most(10.0);
        /// diffusivity along the interface
        diffusivity: f64 = 0.0, in NOT_NEGATIVE;
    }
}

crate::choice! {
    /// Where normals and curvatures come from.
    pub enum GeometryChoice {
        /// closest points of a level set that particles carry
        Pcp = "pcp" {
            /// width of the band in h; 4 ε/h + 1 when not given
            band_h: Option<f64>, in POSITIVE;
            /// parameters of the fits and queries
            method: PcpSpec => flatten;
        }
        /// the smoothed color of the phases (PCP paper, eqs. B.5 to B.10)
        Colorfield = "colorfield",
    }
}

crate::words! {
    /// The smoothing kernel W.
    pub enum KernelWord {
        /// Wendland C²
        WendlandC2 = "wendland_c2",
        /// Wendland C⁴
        WendlandC4 = "wendland_c4",
        /// cubic spline
        CubicSpline = "cubic_spline",
        /// quintic spline
        QuinticSpline = "quintic_spline",
    }
}

crate::group! {
    /// Dimensionless numbers, with the diameter D of the smallest drop and the fluid inside; Re, We and Ca follow, at the largest
    /// speed that is expected.
    pub struct NumbersSpec: Default {
        /// Laplace number τρD/η²
        laplace as "La": Option<f64>, in NOT_NEGATIVE;
        /// Ohnesorge number η/√(ρτD), which is 1/√La
        ohnesorge as "Oh": Option<f64>, in NOT_NEGATIVE;
        /// Reynolds number ρUD/η
        reynolds as "Re": Option<f64>, in NOT_NEGATIVE;
        /// Weber number ρU²D/τ
        weber as "We": Option<f64>, in NOT_NEGATIVE;
        /// capillary number ηU/τ
        capillary as "Ca": Option<f64>, in NOT_NEGATIVE;
        /// Bond number |ρ − ρ_outside| g D²/τ; given, gravity acts along −y, with balance mean
        bond as "Bo": Option<f64>, in NOT_NEGATIVE;
        /// density outside by that inside
        density_ratio: Option<f64>, in POSITIVE;
        /// viscosity outside by that inside
        viscosity_ratio: Option<f64>, in NOT_NEGATIVE;
        /// diameter by spacing
        diameter_over_h as "D_over_h": Option<f64>, in POSITIVE;
        /// radius by spacing
        radius_over_h as "R_over_h": Option<f64>, in POSITIVE;
    }
}

impl WallSpec {
    /// Whether an angle was given.
    #[must_use]
    pub fn has_angle(&self) -> bool {
        self.contact_angle.is_some() || self.advancing_angle.is_some() || self.receding_angle.is_some()
    }
}

impl BoxSpec {
    /// The largest speed at which walls move, or at which a shear moves what is a radius away.
    #[must_use]
    pub fn side_speed(&self, radius: f64) -> f64 {
        let wall = |wall: &WallSpec| wall.velocity.iter().flat_map(|v| v.iter()).map(|u| u * u).sum::<f64>().sqrt();
        let speeds = self.axes.iter().flat_map(|axes| &axes.0).map(|axis| match axis {
            AxisSpec::Periodic => 0.0,
            AxisSpec::Walls { low, high } => wall(low).max(wall(high)),
            AxisSpec::LeesEdwards { shear_rate } => (shear_rate * radius).abs(),
        });
        speeds.fold(0.0, f64::max)
    }

    /// Whether there are walls along any axis.
    #[must_use]
    pub fn has_walls(&self) -> bool {
        self.axes.iter().flat_map(|axes| &axes.0).any(|axis| matches!(axis, AxisSpec::Walls { .. }))
    }
}

/// Smoothing lengths ε in h.
const SMOOTHING: Interval = Interval::at_least(1.0).and_at_most(8.0);

crate::choice! {
    /// How the flow is discretized.
    pub enum DiscretizationChoice {
        /// smoothed particle hydrodynamics
        Sph = "sph" {
            /// the kernel W
            kernel: KernelWord = KernelWord::WendlandC2;
            /// smoothing length ε in h; by case when not given
            smoothing_h: Option<f64>, in SMOOTHING;
        }
        /// DC-PSE: fits of polynomials about every particle for pressure gradient and viscosity, densities by continuity
        Dcpse = "dcpse" {
            /// 2 or 4: polynomials of degree 3 or 5
            order: u64 = 2, in whole(2, 4);
            /// radius of the fits in h; 3.5, of order 4 5.5, when not given; 3 is the paper's, with which particles crowd here
            cutoff_h: Option<f64>, in Interval::at_least(2.0).and_at_most(8.0);
            /// smoothing length ε in h; by case when not given
            smoothing_h: Option<f64>, in SMOOTHING;
        }
    }
}

crate::choice! {
    /// Where densities come from.
    pub enum DensityChoice {
        /// summation, with pressures in the volume form (PCP paper, eqs. B.1, B.2)
        Summation = "summation",
        /// continuity with diffusion, and pressures in the mass form (PCP paper, eqs. B.12 to B.14)
        Continuity = "continuity" {
            /// coefficient ξ̂ of the diffusion
            diffusion: f64 = 0.05, in NOT_NEGATIVE;
        }
    }
}

crate::words! {
    /// Particle shifting.
    pub enum Shifting {
        /// none
        None = "none",
        /// the particle-shifting technique (PCP paper, eqs. B.15, B.16)
        Pst = "pst",
    }
}

crate::words! {
    /// What balances a constant force.
    pub enum Balance {
        /// nothing, which is refused for fluids of two densities
        None = "none",
        /// nothing, even for fluids of two densities: everything falls freely
        FreeFall = "free_fall",
        /// the mean force is taken out, which leaves buoyancy: (1 − ρ̄/ρ) g with the mean density ρ̄ of the box
        Mean = "mean",
    }
}

crate::choice! {
    /// A force from outside.
    pub enum ForceChoice {
        /// none
        None = "none",
        /// along x on the inner fluid: F sin(πt/T) sin(πx/A) cos(πy/2B) (cos(πz/2C)) until T (PCP paper, eqs. 29, 30)
        Pulse = "pulse" {
            /// strength F
            coefficient: f64;
            /// duration T
            duration: f64, in POSITIVE;
            /// half the wave length along x
            a as "A": f64 = 0.5, in POSITIVE;
            /// a quarter of the wave length along y
            b as "B": f64 = 0.5, in POSITIVE;
            /// a quarter of the wave length along z
            c as "C": f64 = 0.5, in POSITIVE;
        }
        /// the same acceleration everywhere
        Constant = "constant" {
            /// acceleration
            acceleration: Coordinates;
            /// what balances the force in the periodic box; fluids of two densities need mean
            balance: Balance = Balance::None;
        }
        /// a force of one's own
        Formula = "formula" {
            /// components of the acceleration: formulas of x, y, z, `inside` (1 in the drop, 0 elsewhere) and t
            acceleration: FormulaList, in Items(2, 3, ());
            /// numbers that the formulas call by name
            parameters: NamedNumbers = constants();
        }
    }
}

crate::group! {
    /// Velocities at the start, as formulas of x, y and z, or as numbers.
    pub struct InitialVelocitySpec {
        /// components in the fluid inside; 0 when not given
        inside: Option<FormulaList>, in Items(2, 3, ());
        /// components in each part of a union, instead of `inside`
        parts: Option<FormulaLists>, in Items(1, usize::MAX, Items(2, 3, ()));
        /// components in the fluid outside; 0 when not given
        outside: Option<FormulaList>, in Items(2, 3, ());
        /// numbers that the formulas call by name
        parameters: NamedNumbers = constants();
    }
}

crate::words! {
    /// The integrator.
    pub enum IntegratorWord {
        /// one evaluation a step
        KickDriftKick = "kick_drift_kick",
        /// two evaluations a step (the paper's)
        PredictorCorrector = "predictor_corrector",
    }
}

crate::choice! {
    /// An end before the end time.
    pub enum StopWhen {
        /// every speed has stayed below a bound for 50 steps
        AtRest = "at_rest" {
            /// the bound
            velocity: f64, in POSITIVE;
        }
    }
}

crate::group! {
    /// Two fluids with surface tension.
    pub struct Droplet {
        /// what starts: an ellipse at rest, a circle that a force tears apart, a circle at rest, or any shape
        case: CaseName = CaseName::Oscillating;
        /// 2 or 3; when not given, that of the shape, else 2
        dimension: Option<usize>, in whole(2, 3);
        /// the drop at the start; by case when not given
        shape: Option<Shape>;
        /// the box; by case, and periodic along every axis, when not given
        domain: Option<BoxSpec>;
        /// bodies that stand in the fluids, thicker than neighbors reach; none when not given
        obstacles: Option<Listed<ObstacleSpec>>, in Items(1, MOST_OBSTACLES, ());
        /// distance h of neighboring particles: the volume of a particle is about h^D, whatever the lattice
        spacing: f64 = 0.031_25, in POSITIVE;
        /// velocity of both fluids at the start; 0 when not given
        velocity: Option<Coordinates>;
        /// velocities of the fluids at the start, on top of `velocity`; 0 when not given
        initial_velocity: Option<InitialVelocitySpec>;
        /// scene time at the end
        end_time: f64 = 1.0, in POSITIVE => restart_safe;
        /// time step Δt, kept whatever the speeds; when neither it nor steps is given, the longest stable one, cut into parts
        /// where speeds ask for it
        time_step: Option<f64>, in POSITIVE => restart_safe;
        /// number of equal steps, instead of time_step
        steps: Option<u64>, in whole(1, 1_000_000_000);
        /// the fluids inside and outside
        fluids: Fluids = Fluids::default();
        /// a scene by dimensionless numbers, with ρ = τ = 1 and, without a shape, R = 1, in place of fluids, surface_tension, spacing
        /// and domain; in a resolved scene the numbers that follow from it
        numbers: Option<NumbersSpec>;
        /// surface tension τ; by case when not given; with 0 no interface is computed
        surface_tension: Option<f64>, in NOT_NEGATIVE;
        /// balanced: −(τ/ρ)(κ − κ₀) n δ with the curvature κ₀ of a ball for each droplet; balanced_0_1: that of version 0.1;
        /// csf: κ₀ = 0 (the paper)
        tension_force: TensionWord = TensionWord::Balanced;
        /// b of a surface tension τ₀ (1 + b·x), x from the middle of the box, as a gradient of temperature sets it; it jumps at the
        /// sides of the box, where no interface may be
        tension_slope: Option<Coordinates>;
        /// a surfactant on the interface, which lowers its tension; none when not given
        surfactant: Option<SurfactantSpec>;
        /// where normals and curvatures come from
        geometry: GeometryChoice = with_defaults("pcp");
        /// how the flow is discretized
        discretization: DiscretizationChoice = with_defaults("sph");
        /// where densities come from; by case when not given
        density_method: Option<DensityChoice>;
        /// lattice of the particles at the start; by tension_force and dimension when not given
        lattice: Option<LatticeWord>;
        /// how volumes follow from sums of kernels, for densities by summation; by tension_force when not given
        volumes: Option<VolumesWord>;
        /// pressure p_b in τκ₀, κ₀ the curvature of the smallest drop at the start, for densities by summation; it keeps particles
        /// apart, and acts as a weak elasticity; by tension_force when not given. Between walls gravity adds the pressure of its height
        background_pressure: Option<f64>, in NOT_NEGATIVE.and_at_most(100.0);
        /// coefficient β of the pressure −β ρ c ε ∇·u, for densities by summation and kick_drift_kick; by tension_force when not
        /// given; 2 holds, 5 does not
        bulk_damping: Option<f64>, in NOT_NEGATIVE.and_at_most(2.0);
        /// what becomes of the level that particles carry, for geometry pcp; by tension_force when not given
        redistancing: Option<RedistancingChoice>;
        /// radius in h of the surface filter of the curvature, 0 for none, for geometry pcp; by tension_force when not given
        curvature_filter_h: Option<f64>, in NOT_NEGATIVE.and_at_most(20.0);
        /// particle shifting; when not given, pst where a force, a moving wall or a shear deforms fluids between walls or in a box in shear, else by case
        shifting: Option<Shifting>;
        /// a force from outside; by case when not given
        body_force: Option<ForceChoice>;
        /// whether a speed of sound below half of that which keeps the fluids nearly incompressible is let through
        allow_soft: bool = false;
        /// kick_drift_kick: one evaluation a step; predictor_corrector: two (the paper's)
        integrator: IntegratorWord = IntegratorWord::KickDriftKick;
        /// an end before the end time
        stop_when: Option<StopWhen>;
    }
}
