//! A torus by its mean curvature, independently of the project's methods.

/// When a torus has collapsed by its mean curvature: the outline of its section in (r, z), velocity −(κ + n_r/r) n, by explicit steps of
/// equally spaced points until it has a fiftieth of its radius; what is left takes its area/2π.
pub fn extinction_of_ring(major: f64, minor: f64) -> f64 {
    const POINTS: usize = 120;
    let angle = |k: usize| k as f64 * std::f64::consts::TAU / POINTS as f64;
    let mut outline: Vec<[f64; 2]> =
        (0..POINTS).map(|k| [major + minor * angle(k).cos(), minor * angle(k).sin()]).collect();
    let ways = |outline: &[[f64; 2]]| -> Vec<f64> {
        let next = |k: usize| outline[(k + 1) % POINTS];
        (0..POINTS).map(|k| (next(k)[0] - outline[k][0]).hypot(next(k)[1] - outline[k][1])).collect()
    };
    let mut time = 0.0;
    loop {
        let neighbors = |k: usize| (outline[(k + POINTS - 1) % POINTS], outline[k], outline[(k + 1) % POINTS]);
        let area: f64 = (0..POINTS).map(neighbors).map(|(_, a, b)| 0.5 * (a[0] * b[1] - b[0] * a[1])).sum();
        if area < std::f64::consts::PI * (0.02 * minor).powi(2) {
            return time + area / std::f64::consts::TAU;
        }
        let step = 0.2 * (ways(&outline).iter().sum::<f64>() / POINTS as f64).powi(2);
        let moved = |k: usize| {
            let (a, x, b) = neighbors(k);
            let first = [0.5 * (b[0] - a[0]), 0.5 * (b[1] - a[1])];
            let second = [b[0] - 2.0 * x[0] + a[0], b[1] - 2.0 * x[1] + a[1]];
            let length = first[0].hypot(first[1]);
            let normal = [first[1] / length, -first[0] / length];
            let speed = (first[0] * second[1] - first[1] * second[0]) / length.powi(3) + normal[0] / x[0];
            [x[0] - step * speed * normal[0], x[1] - step * speed * normal[1]]
        };
        let next: Vec<[f64; 2]> = (0..POINTS).map(moved).collect();
        time += step;
        let lengths = ways(&next);
        let least = lengths.iter().copied().fold(f64::INFINITY, f64::min);
        if lengths.iter().all(|length| *length < 1.2 * least) {
            outline = next;
            continue;
        }
        // Equally spaced again; every time would cut the corners of the polygon every time.
        let each = lengths.iter().sum::<f64>() / POINTS as f64;
        let (mut k, mut passed) = (0, 0.0);
        outline = (0..POINTS)
            .map(|i| {
                let place = i as f64 * each;
                while k + 1 < POINTS && passed + lengths[k] < place {
                    passed += lengths[k];
                    k += 1;
                }
                let (share, end) = ((place - passed) / lengths[k], next[(k + 1) % POINTS]);
                std::array::from_fn(|d| next[k][d] + share * (end[d] - next[k][d]))
            })
            .collect();
    }
}
