//! The parameters of a `surface_pde` scene.

use super::field_spec::{FieldChoice, FieldValue, InitialChoice, everywhere};
use super::transport_spec::{MotionChoice, VelocityChoice};
use crate::formulas::{FormulaList, NamedNumbers, constants};
use crate::scene::cloud::PointsSource;
use crate::schemes::surface_equation::MOST_SPECIES;
use crate::spec::choice::with_defaults;
use crate::spec::{Coordinates, Interval, Items, Listed, NOT_NEGATIVE, POSITIVE, Places, Sign, whole};

crate::words! {
    /// What happens to points that coincide with others, and to points far from all others.
    pub enum CleanWord {
        /// they are left out and counted
        Drop = "drop",
        /// points with such a fault are refused
        Refuse = "refuse",
        /// they are kept
        Off = "off",
    }
}

crate::choice! {
    /// A surface about the origin.
    pub enum SurfaceChoice {
        /// a circle in the plane
        Circle = "circle" {
            /// radius R
            radius: f64 = 1.0, in POSITIVE;
        }
        /// a sphere
        Sphere = "sphere" {
            /// radius R
            radius: f64 = 1.0, in POSITIVE;
        }
        /// an ellipsoid; its Fibonacci points are those of the unit sphere, stretched
        Ellipsoid = "ellipsoid" {
            /// semi-axes along x, y and z
            semi_axes: Coordinates = [1.0, 0.8, 0.75].into(), in Sign::Positive;
        }
        /// a torus about z
        Torus = "torus" {
            /// radius of the core circle
            major_radius: f64 = 1.0, in POSITIVE;
            /// radius of the tube, less than the major one
            minor_radius: f64 = 0.4, in POSITIVE;
        }
        /// the square [−2, 2]² with a bump α ζ(|x − p|/r) of r = 0.25 at p = (−0.5, 0), edges without flux
        Bump = "bump" {
            /// height α
            height: f64 = 1.0, in Interval::at_least(0.0).and_at_most(10.0);
        }
        /// points of a file (HDF5, PLY, OBJ, XYZ), with normals where it has some; nothing is known of it exactly
        Points = "points" {
            /// where the points come from
            source: PointsSource => flatten;
            /// points that coincide with others, and strays: `drop` leaves them out and counts them
            clean: CleanWord = CleanWord::Drop;
        }
    }
}

crate::words! {
    /// How points are spread.
    pub enum SamplingWord {
        /// equal areas, turned by the golden angle
        Fibonacci = "fibonacci",
        /// at equal angles, or on a lattice
        Regular = "regular",
        /// at random, relaxed
        Random = "random",
        /// at random, as drawn
        RandomRaw = "random_raw",
    }
}

crate::words! {
    /// What makes the solution of a Poisson equation unique.
    pub enum ConditionWord {
        /// points next to the plane x = 0 (on a circle the one at (R, 0)) hold their value
        Dirichlet = "dirichlet",
        /// the solution has no mean
        ZeroMean = "zero_mean",
    }
}

crate::words! {
    /// What holds at the edges of a surface.
    pub enum EdgesWord {
        /// no flux
        Neumann = "neumann",
    }
}

crate::choice! {
    /// What equations keep to at the edges of points from outside: points with neighbors on one side alone.
    pub enum EdgesChoice {
        /// nothing flows through the edges
        Neumann = "neumann",
        /// points of the edges hold a value
        Dirichlet = "dirichlet" {
            /// the value: a number, a formula of x, y, z, nx, ny, nz, or data at the points
            value: FieldValue = everywhere(0.0);
            /// with it, points x of edges with normal·x ≥ offset hold the value, and nothing flows through the other ones
            normal: Option<Coordinates>;
            /// offset of the half-space of `normal`
            offset: f64 = 0.0;
        }
        /// the surface repeats: beyond an edge it goes on at the opposite one; nothing flows through other edges
        Periodic = "periodic" {
            /// the way from an edge to where the surface goes on
            period: Coordinates;
            /// a second one
            second_period: Option<Coordinates>;
        }
    }
}

crate::choice! {
    /// The integrator of time.
    pub enum EvolutionChoice {
        /// the pair of Dormand and Prince, explicit
        Dopri5 = "dopri5" {
            /// root mean square of the error of a step by 1 + |u|; 1e-7 when neither it nor Δt is given, steps of Δt when only
            /// Δt is
            tolerance: Option<f64>, in STEP_TOLERANCE;
        }
        /// the second backward differentiation formula, implicit; `solver` solves it
        Bdf2 = "bdf2",
    }
}

crate::choice! {
    /// A reaction of substances.
    pub enum ModelChoice {
        /// −u v² + F (1 − u), u v² − (F + k) v
        GrayScott = "gray_scott" {
            /// feed rate F
            feed: f64 = 0.04, in POSITIVE;
            /// kill rate k
            kill: f64 = 0.06, in POSITIVE;
        }
        /// a − (b + 1) u + u² v, b u − u² v
        Brusselator = "brusselator" {
            /// supply a
            a: f64 = 3.0, in POSITIVE;
            /// rate b
            b: f64 = 9.0, in POSITIVE;
        }
        /// γ (a − u + u² v), γ (b − u² v)
        Schnakenberg = "schnakenberg" {
            /// supply a
            a: f64 = 0.1, in NOT_NEGATIVE;
            /// supply b
            b: f64 = 0.9, in POSITIVE;
            /// rate γ
            gamma: f64 = 1.0, in POSITIVE;
        }
        /// reaction terms of one's own, of one to six substances
        Formula = "formula" {
            /// names of the substances, which the rates call them by
            species: Listed<String>, in Items(1, MOST_SPECIES, ());
            /// rate of each substance: a formula of the substances, x, y, z, the unit normal nx, ny, nz and t
            rates: FormulaList, in Items(1, MOST_SPECIES, ());
            /// diffusivity d of each substance: a number, a formula of x, y, z, nx, ny, nz, or data; then ∇ₛ·(d ∇ₛ u)
            diffusivities: Listed<FieldValue>, in Items(1, MOST_SPECIES, ());
            /// each substance at the start: a formula of x, y, z, nx, ny, nz, or data at the points
            initial: Listed<FieldValue>, in Items(1, MOST_SPECIES, ());
            /// numbers that the formulas call by name
            parameters: NamedNumbers = constants();
        }
    }
}

/// Tolerances of a step.
const STEP_TOLERANCE: Interval = Interval::at_least(1e-14).and_at_most(1.0);

crate::choice! {
    /// What is computed.
    pub enum ProblemSpec {
        /// Δₛ of a field: `value` against `reference`
        LaplaceBeltrami = "laplace_beltrami" {
            /// the field; `spherical_harmonic` on spheres, `sin_plus_cos` on circles, else `plane_wave` when not given
            field: Option<FieldChoice>;
        }
        /// ∇ₛ of a field, and its divergence
        Gradient = "gradient" {
            /// the field; `plane_wave` when not given
            field: Option<FieldChoice>;
        }
        /// Δₛ u = Δₛ of a field: `value` is u, `reference` the field; on points Δₛ u = the field less its mean
        Poisson = "poisson" {
            /// the field; `spherical_harmonic` on spheres, `sin_plus_cos` on circles, else `plane_wave` when not given
            field: Option<FieldChoice>;
            /// a right-hand side s instead of `field`: Δₛ u = s less its mean
            source: Option<FieldChoice>;
            /// points next to the plane x = 0 (on a circle the one at (R, 0)) hold their value, or u has no mean
            condition: ConditionWord = ConditionWord::ZeroMean;
        }
        /// ∂u/∂t = ∇ₛ·(d ∇ₛ u) + s
        Diffusion = "diffusion" {
            /// u at the start; `truncated_gaussian` on bumps, else an eigenfunction, when not given
            initial: Option<InitialChoice>;
            /// diffusivity d: a number, a formula of x, y, z, the unit normal nx, ny, nz, or data at the points
            diffusivity: FieldValue = everywhere(1.0);
            /// a source s: a formula of x, y, z, nx, ny, nz and t, or data at the points
            source: Option<FieldValue>;
            /// numbers that these formulas call by name
            parameters: NamedNumbers = constants();
            /// end time T
            end_time: f64 = 1.0, in POSITIVE;
            /// time step Δt; when not given, a hundredth of T, which `dopri5` divides as its tolerance asks
            time_step: Option<f64>, in POSITIVE;
            /// integrator of time; `bdf2` on points from outside, else `dopri5`, when not given
            integrator: Option<EvolutionChoice>;
            /// condition at the edges of a bump
            edges: EdgesWord = EdgesWord::Neumann;
        }
        /// ∂u/∂t + ∇ₛ·(u v) = d Δₛ u with a tangential velocity v
        Advection = "advection" {
            /// u at the start; an eigenfunction where the surface has known ones, else `plane_wave`, when not given
            initial: Option<InitialChoice>;
            /// the velocity v
            velocity: VelocityChoice = with_defaults("rotation");
            /// diffusivity d
            diffusivity: f64 = 0.0, in NOT_NEGATIVE;
            /// end time T
            end_time: f64 = 1.0, in POSITIVE;
            /// time step Δt, which is divided as stability asks; when not given, a hundredth of T
            time_step: Option<f64>, in POSITIVE;
        }
        /// ∂u/∂t + u ∇ₛ·v = d Δₛ u at points that go along with a surface that moves with v
        MovingDiffusion = "moving_diffusion" {
            /// u at the start; an eigenfunction where the surface has known ones, else `plane_wave`, when not given
            initial: Option<InitialChoice>;
            /// the motion
            motion: MotionChoice = with_defaults("expansion");
            /// diffusivity d
            diffusivity: f64 = 0.1, in NOT_NEGATIVE;
            /// end time T
            end_time: f64 = 1.0, in POSITIVE;
            /// time step Δt; when not given, a hundredth of T
            time_step: Option<f64>, in POSITIVE;
        }
        /// mean and Gauss curvature, from normals or from points alone
        Curvature = "curvature",
        /// −Δₛ u = λ u: the least eigenvalues, one a step, with their modes
        Eigenvalues = "eigenvalues" {
            /// number of eigenvalues
            count: u64 = 16, in whole(1, 500);
        }
        /// distance along the surface from points of it
        GeodesicDistance = "geodesic_distance" {
            /// places; distances are measured from the points that are nearest to them. The point with the largest last coordinate
            /// when not given
            from: Option<Places>;
        }
        /// substances that react and diffuse
        ReactionDiffusion = "reaction_diffusion" {
            /// the reaction
            model: ModelChoice = with_defaults("brusselator");
            /// diffusivity of the first substance; 0.005 when not given; formulas have `diffusivities` instead
            diffusivity: Option<f64>, in POSITIVE;
            /// diffusivity of the second substance; 0.05 when not given; formulas have `diffusivities` instead
            second_diffusivity: Option<f64>, in POSITIVE;
            /// amplitude of the random disturbance at the start, by the values
            noise: f64 = 0.1, in NOT_NEGATIVE;
            /// a field f for which forcing makes u = u₀ (1 + f cos t/4), v = v₀ (1 − f cos t/4) exact
            manufactured: Option<FieldChoice>;
            /// end time T
            end_time: f64 = 10.0, in POSITIVE;
            /// time step Δt; when not given, a hundredth of T, which is divided as the tolerance asks
            time_step: Option<f64>, in POSITIVE;
            /// root mean square of the error of a step by 1 + |u|; 1e-7 when neither it nor Δt is given, steps of Δt when only
            /// Δt is
            tolerance: Option<f64>, in STEP_TOLERANCE;
        }
    }
}

crate::words! {
    /// The form of Surface DC-PSE operators.
    pub enum FormWord {
        /// on tangent planes
        Intrinsic = "intrinsic",
        /// in space, with copies of the points along normals: the paper's
        Copies = "copies",
    }
}

crate::words! {
    /// How the neighbors of a fit are found.
    pub enum SupportsWord {
        /// all points within a radius that is the same everywhere
        Ball = "ball",
        /// along the edges of stars, within a radius that follows the local spacing and grows until the row is bounded
        Stars = "stars",
    }
}

crate::choice! {
    /// The method.
    pub enum MethodSpec {
        /// fits with supports along stars; where an equation is solved and too many points have no bounded fit, the conservative form
        Auto = "auto" {
            /// 2, 4 or 6: polynomials of degree 3, 5 or 7; the conservative form has order 2. 4 when not given for `eigenvalues` and
            /// `curvature`, where the points resolve the surface for it; else 2
            order: Option<u64>, in whole(2, 6);
            /// cutoff radius r_c in local spacings; 2.4, 3.3, 4.2 (on curves 3.4, 5.4, 7.4) when not given
            cutoff_dn: Option<f64>, in Interval::above(1.0).and_at_most(20.0);
        }
        /// exchange between Voronoi cells in tangent planes, of order 2: keeps the integral and the bounds of a field; for equations
        Conservative = "conservative",
        /// Surface DC-PSE: fits of polynomials about every point
        SurfaceDcpse = "surface_dcpse" {
            /// 2, 4 or 6: polynomials of degree 3, 5 or 7
            order: u64 = 2, in whole(2, 6);
            /// `intrinsic`: on tangent planes; `copies`: in space, with copies of the points along normals, the paper's
            form: FormWord = FormWord::Intrinsic;
            /// cutoff radius r_c in δn; 2.4, 3.3, 4.2 (of `random_raw` 3.5, 4, 4.5; copies 2.9, on circles 4.1) when not given
            cutoff_dn: Option<f64>, in Interval::above(1.0).and_at_most(20.0);
            /// copies of a point to either side; 2, on circles 4, when not given
            layers: Option<u32>, in whole(1, 16);
            /// distance δn of the copies; √(area/N), on circles 3 R/(N − 1), when not given
            normal_spacing: Option<f64>, in POSITIVE;
            /// how neighbors of intrinsic fits are found; `stars` on points from outside, else `ball`, when not given
            supports: Option<SupportsWord>;
        }
        /// the embedding closest-point method on a grid about the surface, for `laplace_beltrami`
        ClosestPoint = "closest_point" {
            /// 2 or 4
            order: u64 = 2, in whole(2, 4);
            /// spacing of the grid; √(area/N) when not given
            spacing: Option<f64>, in POSITIVE;
        }
    }
}

crate::words! {
    /// Where the metric of a fit comes from.
    pub enum MetricWord {
        /// heights are fitted
        Heights = "heights",
        /// normals are taken as exact
        Normals = "normals",
    }
}

crate::choice! {
    /// The normals that operators are made with.
    pub enum NormalsChoice {
        /// those of the surface
        Exact = "exact",
        /// those that came with points, estimated where none did
        Given = "given" {
            /// `heights` are fitted, or normals are taken as exact (then they must have come)
            metric: MetricWord = MetricWord::Heights;
        }
        /// from the points alone, the metric by fitted heights
        Estimated = "estimated",
        /// exact ones turned at random
        Perturbed = "perturbed" {
            /// largest change of a component
            sigma: f64 = 0.01, in NOT_NEGATIVE;
            /// `heights` are fitted, or normals are taken as if they were exact
            metric: MetricWord = MetricWord::Heights;
        }
    }
}

/// Tolerances of a solver.
const RESIDUAL: Interval = Interval::at_least(1e-14).and_at_most(0.1);

crate::group! {
    /// When an iterative solver stops.
    pub struct StoppingSpec: Default {
        /// bound of ‖b − A x‖ by ‖b‖
        tolerance: f64 = 1e-10, in RESIDUAL;
        /// number of iterations at most
        max_iterations: u64 = 5000, in whole(1, 100_000_000);
    }
}

crate::choice! {
    /// How systems of equations are solved.
    pub enum SolverChoice {
        /// `cg` where the operator is conservative, else `bicgstab`
        Auto = "auto" {
            /// when it stops
            stopping: StoppingSpec => flatten;
        }
        /// conjugate gradients with incomplete Cholesky factors; for the method `conservative`
        Cg = "cg" {
            /// when it stops
            stopping: StoppingSpec => flatten;
        }
        /// BiCGSTAB with ILU(0); where it stalls GMRES goes on, and then sparse LU
        Bicgstab = "bicgstab" {
            /// when it stops
            stopping: StoppingSpec => flatten;
        }
        /// restarted GMRES with ILU(0)
        Gmres = "gmres" {
            /// vectors of the basis before a restart
            restart: usize = 60, in whole(2, 1000);
            /// when it stops
            stopping: StoppingSpec => flatten;
        }
        /// sparse LU decomposition
        SparseLu = "sparse_lu",
    }
}

crate::group! {
    /// Operators and equations on a surface that is known by points.
    pub struct SurfacePde {
        /// the surface, about the origin
        surface: SurfaceChoice = with_defaults("sphere");
        /// dimension of the space: 2 for circles, of points when it is given, else 3
        dimension: Option<usize>, in whole(2, 3);
        /// number of points; of a bump about; 4000 when not given
        count: Option<u64>, in whole(20, 100_000_000);
        /// how points are spread: `regular` on circles and bumps, else `fibonacci`, when not given; `random` is relaxed
        sampling: Option<SamplingWord>;
        /// what is computed
        problem: ProblemSpec = ProblemSpec::LaplaceBeltrami { field: None };
        /// the method; `auto` for points, else `surface_dcpse`, when not given
        method: Option<MethodSpec>;
        /// the normals that operators are made with; `given` for points, else `exact`, when not given
        normals: Option<NormalsChoice>;
        /// what equations keep to at the edges of points from outside
        edges: EdgesChoice = EdgesChoice::Neumann;
        /// how systems of equations are solved: those of `poisson` and of `bdf2`; `auto` for points, else `bicgstab`, when not given
        solver: Option<SolverChoice>;
        /// seed of random points and normals
        seed: u64 = 1;
        /// applications of the operator in a row, one a step; of `laplace_beltrami`
        repeat: u64 = 1, in whole(1, 1_000_000) => restart_safe;
    }
}
