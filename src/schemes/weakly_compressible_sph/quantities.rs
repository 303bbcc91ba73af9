//! What series and reports of two fluids show.

use crate::schemes::measured_errors;
use crate::simulation::Quantity;
use crate::simulation::quantity::{quantities, without_repetition};

quantities! {
    /// Scalars of the series.
    pub OBSERVABLES {
        TIME = "time", "time", "Scene time.";
        TIME_STEP = "time_step", "time", "Length of the parts that the last step was made of.";
        KINETIC_ENERGY = "kinetic_energy", "mass*length^2/time^2", "Sum of m u^2/2 over all particles.";
        MOMENTUM_X = "momentum_x", "mass*length/time", "Sum of m u over all particles, along x.";
        MOMENTUM_Y = "momentum_y", "mass*length/time", "Sum of m u over all particles, along y.";
        MOMENTUM_Z = "momentum_z", "mass*length/time", "Sum of m u over all particles, along z.";
        CURVATURE_MEAN = "curvature_mean", "1/length", "Mean curvature over the particles that feel surface tension, those at fragments left out.";
        CURVATURE_STD = "curvature_std", "1/length", "Standard deviation of the curvature over the same particles.";
        AREA = "area", "length^2", "Area of the inner fluid, by quadrature on the fits.";
        VOLUME = "volume", "length^3", "Volume of the inner fluid, by quadrature on the fits.";
        CENTER_X = "center_x", "length", "Centroid of the inner fluid, along x.";
        CENTER_Y = "center_y", "length", "Centroid of the inner fluid, along y.";
        CENTER_Z = "center_z", "length", "Centroid of the inner fluid, along z.";
        EXTENT_X = "extent_x", "length", "Extent of the inner fluid, along x.";
        EXTENT_Y = "extent_y", "length", "Extent of the inner fluid, along y.";
        EXTENT_Z = "extent_z", "length", "Extent of the inner fluid, along z.";
        DEFORMATION = "deformation", "", "(Qxx - Qyy)/(Qxx + Qyy) of the central second moments.";
        PRESSURE_INSIDE = "pressure_inside", "mass/(length*time^2)", "Mean pressure well inside the inner fluid.";
        PRESSURE_OUTSIDE = "pressure_outside", "mass/(length*time^2)", "Mean pressure well outside the inner fluid.";
        PRESSURE_EOS_JUMP = "pressure_eos_jump", "mass/(length*time^2)", "Jump of the pressure by the equation of state alone.";
        PRESSURE_JUMP_MEASURED = "pressure_jump_measured", "mass/(length*time^2)", "Jump of the pressure as particles have it: by the equation of state, and what the force of surface tension takes over summed over the particles.";
        PRESSURE_BALANCED = "pressure_balanced", "mass/(length*time^2)", "Jump tau kappa_0, with the mean tension of the droplet, that the balanced force takes out of the pressure.";
        PRESSURE_INSIDE_COUNT = "pressure_inside_count", "particles", "Particles over which the pressure inside is a mean.";
        RISE_VELOCITY = "rise_velocity", "length/time", "Mean velocity of the fluid inside against a constant body force.";
        RISE_HEIGHT = "rise_height", "length", "Mean place of the fluid inside against a constant body force, between walls.";
        WETTED = "wetted", "length^(D-1)", "Length or area of the walls that the fluid inside covers.";
        CONTACT_ANGLE = "contact_angle", "degrees", "Mean angle between interface and walls, measured in the fluid inside.";
        CONTACT_LOW = "contact_low", "length", "Place along x of the contact line that faces low x, in the plane.";
        CONTACT_WIDTH = "contact_width", "length", "Width between the contact lines of a drop on a wall, in the plane.";
        CONTACT_HIGH = "contact_high", "length", "Place along x of the contact line that faces high x, in the plane.";
        WAVE_AMPLITUDE = "wave_amplitude", "length", "Amplitude of the wave on the sides of a layer.";
        TENSION_MIN = "tension_min", "", "Least surface tension on the interface, by that of the scene.";
        TENSION_MAX = "tension_max", "", "Largest surface tension on the interface, by that of the scene.";
        SURFACTANT = "surfactant", "length^(D-1)", "Amount of the surfactant: the integral of its coverage over the interface.";
        SURFACTANT_OFF_INTERFACE = "surfactant_off_interface", "", "Share of the surfactant on particles that are far from any interface.";
        COVERAGE_MIN = "coverage_min", "", "Least coverage of the interface by the surfactant.";
        COVERAGE_MAX = "coverage_max", "", "Largest coverage of the interface by the surfactant.";
        SHEAR_STRESS = "shear_stress", "mass*length^(2-D)/time^2", "Mean shear stress of a box in shear, with that of the interface.";
        STRAIN = "strain", "", "Shear rate times time of a box in shear.";
        TAYLOR_DEFORMATION = "taylor_deformation", "", "(L - B)/(L + B) of the longest and the shortest axis of a single drop in a box in shear, by its second moments.";
        DROPLETS = "droplets", "", "Connected components of the inner fluid.";
        MACH = "mach", "", "Largest speed by the lower speed of sound.";
        CFL = "cfl", "spacings", "Longest way of a particle in a part of the last step.";
        LEAST_PAIR_DISTANCE_H = "least_pair_distance_h", "spacings", "Least distance of two particles.";
        SPEED_MAX = "speed_max", "length/time", "Largest speed of a particle.";
        PERIMETER = "perimeter", "length", "Length of the interface, as the sum of V delta over the particles.";
        SURFACE_AREA = "surface_area", "length^2", "Area of the interface, as the sum of V delta over the particles.";
        SURFACE_ENERGY = "surface_energy", "mass*length^2/time^2", "Energy of the interface: surface tension times perimeter or surface area, its integral where a slope is given, and that of the energy by area of a covered interface.";
        ELASTIC_ENERGY = "elastic_energy", "mass*length^2/time^2", "Energy of compression of both fluids.";
        WORK = "work", "mass*length^2/time^2", "Work of the body force, and of what keeps up a slope of the tension, since the start.";
        ELONGATION = "elongation", "", "(a - b)/(a + b) of the largest and the least eigenvalue of the central second moments.";
        ELONGATION_ANGLE = "elongation_angle", "radians", "Angle of the longest axis with x, from -pi/2 to pi/2, in the plane.";
        CIRCULARITY = "circularity", "", "Perimeter (in space, area) of the ball of the same area (volume) by that of the interface.";
        MODE_2 = "mode_2", "", "Size of mode 2 of the distance from the centroid over the angle, by its mean, in the plane.";
        MODE_3 = "mode_3", "", "Size of mode 3 of the distance from the centroid over the angle, by its mean, in the plane.";
        MODE_4 = "mode_4", "", "Size of mode 4 of the distance from the centroid over the angle, by its mean, in the plane.";
    }
}

quantities! {
    /// Norms of the report that only this scheme has.
    pub OWN_NORMS {
        MEAN_ERROR = "mean_error", "of the quantity", "Difference of the mean of the last fifth of the run from the reference.";
        STD = "std", "of the quantity", "Standard deviation over the band.";
        STD_LEAST = "std_least", "of the quantity", "Least standard deviation over the band in the run.";
        RISE = "rise", "", "Largest rise above the largest value before, by the surface energy at the start.";
        OF_MEASURE = "of_measure", "", "Relative difference from the curvature of a ball of the present area or volume.";
        SCALED = "scaled", "", "By sqrt(tau/(rho D)), the capillary speed of the drop.";
        RATIO = "ratio", "", "Mean of the last third of the run by that of the middle third.";
        FREQUENCY = "frequency", "1/time", "Angular frequency of the oscillation.";
        DECAY = "decay", "1/time", "Rate of decay of the oscillation.";
        LEAST = "least", "of the quantity", "Least value of the run, no error.";
        BY_GRAVITY = "by_gravity", "", "Largest value of the run by sqrt(g H) of the height between walls.";
        COUNT = "count", "", "Number of items, no error.";
        ZERO_1 = "zero_1", "time", "First time at which the quantity passed zero.";
        ZERO_2 = "zero_2", "time", "Second time at which the quantity passed zero.";
        ZERO_3 = "zero_3", "time", "Third time at which the quantity passed zero.";
        ZERO_4 = "zero_4", "time", "Fourth time at which the quantity passed zero.";
        ZERO_5 = "zero_5", "time", "Fifth time at which the quantity passed zero.";
        ZERO_6 = "zero_6", "time", "Sixth time at which the quantity passed zero.";
        ZERO_7 = "zero_7", "time", "Seventh time at which the quantity passed zero.";
        ZERO_8 = "zero_8", "time", "Eighth time at which the quantity passed zero.";
        EXTREME_1 = "extreme_1", "of the quantity", "First extreme of the quantity.";
        EXTREME_2 = "extreme_2", "of the quantity", "Second extreme of the quantity.";
        EXTREME_3 = "extreme_3", "of the quantity", "Third extreme of the quantity.";
        EXTREME_4 = "extreme_4", "of the quantity", "Fourth extreme of the quantity.";
        EXTREME_5 = "extreme_5", "of the quantity", "Fifth extreme of the quantity.";
        EXTREME_6 = "extreme_6", "of the quantity", "Sixth extreme of the quantity.";
        EXTREME_7 = "extreme_7", "of the quantity", "Seventh extreme of the quantity.";
        EXTREME_8 = "extreme_8", "of the quantity", "Eighth extreme of the quantity.";
    }
}

/// Turns of the deformation that a report shows.
pub const MOST_TURNS: usize = 8;
/// Norms of the times at which the deformation passed zero.
pub(super) static CROSSINGS: [&Quantity; MOST_TURNS] =
    [&ZERO_1, &ZERO_2, &ZERO_3, &ZERO_4, &ZERO_5, &ZERO_6, &ZERO_7, &ZERO_8];
/// Norms of the extremes of the deformation.
pub(super) static EXTREMES: [&Quantity; MOST_TURNS] =
    [&EXTREME_1, &EXTREME_2, &EXTREME_3, &EXTREME_4, &EXTREME_5, &EXTREME_6, &EXTREME_7, &EXTREME_8];

/// Norms of the report.
#[must_use]
pub fn norms() -> Vec<&'static Quantity> {
    let shared: &[&Quantity] =
        &[&measured_errors::MAX, &measured_errors::MEAN, &measured_errors::RELATIVE, &measured_errors::RMS];
    without_repetition(&[shared, OWN_NORMS])
}
