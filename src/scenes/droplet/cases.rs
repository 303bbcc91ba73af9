//! The cases: what holds for each when it is not given.

use serde_json::{Value, json};

/// A case in a dimension.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Case {
    pub shape: Option<Value>,
    pub low: Vec<f64>,
    pub high: Vec<f64>,
    pub tension: f64,
    pub density_method: Value,
    pub shifting: &'static str,
    pub body_force: Value,
    pub time_step: Option<f64>,
    pub smoothing_h: f64,
    /// Degree and r_c/h of the fits.
    pub fits: (u64, f64),
}

/// ε/h that grows with the resolution, as in the paper: 3 at 1/32, 3.25 at 1/48, … 3.75 at 1/80.
fn growing_smoothing(spacing: f64) -> f64 {
    3.0 + 0.25 * ((1.0 / spacing - 32.0) / 16.0).clamp(0.0, 3.0)
}

/// The case of a name; `oscillating` for one that is not known.
pub(super) fn case(name: &str, dimension: usize, spacing: f64) -> Case {
    let is_flat = dimension == 2;
    let both = |plane: Value, space: Value| if is_flat { plane } else { space };
    let cube = |half: f64| (vec![-half; dimension], vec![half; dimension]);
    let (low, high) = cube(1.22);
    let oscillating = Case {
        shape: Some(both(
            json!({"type": "ellipse", "center": null, "semi_axes": [0.75, 0.5]}),
            json!({"type": "ellipsoid", "center": null, "semi_axes": [0.75, 0.5, 0.5]}),
        )),
        low,
        high,
        tension: if is_flat { 50.0 } else { 25.0 },
        density_method: json!("summation"),
        shifting: "none",
        body_force: json!({"type": "none"}),
        time_step: None,
        smoothing_h: if is_flat { 3.0 } else { 2.0 },
        fits: (4, 2.8),
    };
    match name {
        "dividing" => Case {
            shape: Some(both(
                json!({"type": "circle", "center": null, "radius": 0.25}),
                json!({"type": "sphere", "center": null, "radius": 0.25}),
            )),
            low: if is_flat { vec![-1.0, -0.5] } else { vec![-0.75, -0.390_625, -0.390_625] },
            high: if is_flat { vec![1.0, 0.5] } else { vec![0.75, 0.390_625, 0.390_625] },
            tension: 5.0,
            density_method: json!("continuity"),
            shifting: "pst",
            // The force vanishes where the halves come to rest (docs/errata.md, PCP 29 and 30).
            body_force: both(
                json!({"type": "pulse", "coefficient": 1000.0, "duration": 0.5, "A": 0.5, "B": 0.5, "C": 0.5}),
                json!({"type": "pulse", "coefficient": 5000.0, "duration": 0.05, "A": 0.375, "B": 0.390_625, "C": 0.390_625}),
            ),
            time_step: Some(if is_flat { 1e-4 } else { 1.5e-4 }),
            smoothing_h: if is_flat { growing_smoothing(spacing) } else { 2.0 },
            fits: (3, 3.0),
        },
        "static" => Case {
            shape: Some(both(
                json!({"type": "circle", "center": null, "radius": 0.5}),
                json!({"type": "sphere", "center": null, "radius": 0.5}),
            )),
            ..oscillating
        },
        "custom" => Case { shape: None, ..oscillating },
        _ => oscillating,
    }
}

#[cfg(test)]
mod tests {
    use super::growing_smoothing;

    #[test]
    fn smoothing_grows_as_in_the_paper() {
        for (cells, expected) in [(32.0, 3.0), (48.0, 3.25), (64.0, 3.5), (80.0, 3.75), (16.0, 3.0)] {
            assert_eq!(growing_smoothing(1.0 / cells), expected);
        }
    }
}
