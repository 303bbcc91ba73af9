//! Means over the parts of a cloud, and the term that makes an operator regular which maps constants to zero.

/// Weighted means of a vector over parts, and the factor α of each.
///
/// An operator A that maps the constants of each part to zero is singular. The matrix A + Σ_p α_p 1_p w_pᵀ is regular, where 1_p
/// is 1 on part p and w_pᵀ x is the mean of x over it. In a solution of (A + …) x = b the number α_p w_pᵀ x is the constant that
/// must be taken from b in part p for A x = b to have a solution.
#[derive(Debug, Clone, PartialEq)]
pub struct MeanTerm {
    /// Part of each unknown.
    parts: Vec<u32>,
    /// Weight of each unknown.
    weights: Vec<f64>,
    /// Sum of the weights of each part.
    whole: Vec<f64>,
    /// Factor of each part.
    alpha: Vec<f64>,
}

impl MeanTerm {
    /// The term of one part with equal weights.
    #[must_use]
    pub fn uniform(count: usize, alpha: f64) -> Self {
        Self { parts: vec![0; count], weights: vec![1.0; count], whole: vec![count.max(1) as f64], alpha: vec![alpha] }
    }

    /// The term of several parts. The weights of the unknowns are positive, such as areas; `alpha` has one factor per part.
    #[must_use]
    pub fn new(parts: Vec<u32>, weights: Vec<f64>, alpha: Vec<f64>) -> Self {
        let mut whole = vec![0.0; alpha.len()];
        parts.iter().zip(&weights).for_each(|(part, weight)| whole[*part as usize] += weight);
        Self { parts, weights, whole, alpha }
    }

    /// Number of unknowns.
    #[must_use]
    pub fn size(&self) -> usize {
        self.parts.len()
    }

    /// Part of each unknown.
    #[must_use]
    pub fn parts(&self) -> &[u32] {
        &self.parts
    }

    /// Factor of each part.
    #[must_use]
    pub fn alpha(&self) -> &[f64] {
        &self.alpha
    }

    /// The mean of x over each part.
    #[must_use]
    pub fn means(&self, x: &[f64]) -> Vec<f64> {
        let mut means = vec![0.0; self.alpha.len()];
        for ((x, weight), part) in x.iter().zip(&self.weights).zip(&self.parts) {
            means[*part as usize] += weight * x;
        }
        means.iter_mut().zip(&self.whole).for_each(|(mean, whole)| *mean /= whole);
        means
    }

    /// Takes the mean of each part from x, and returns the means.
    pub fn subtract_means(&self, x: &mut [f64]) -> Vec<f64> {
        let means = self.means(x);
        x.iter_mut().zip(&self.parts).for_each(|(x, part)| *x -= means[*part as usize]);
        means
    }

    /// Adds the term, applied to x, to `out`.
    pub fn add_to(&self, x: &[f64], out: &mut [f64]) {
        let mut shares = self.means(x);
        shares.iter_mut().zip(&self.alpha).for_each(|(mean, alpha)| *mean *= alpha);
        out.iter_mut().zip(&self.parts).for_each(|(out, part)| *out += shares[*part as usize]);
    }

    /// Index of the first unknown of each part.
    #[must_use]
    pub fn first_of_parts(&self) -> Vec<usize> {
        let mut first = vec![usize::MAX; self.alpha.len()];
        self.parts.iter().enumerate().rev().for_each(|(i, part)| first[*part as usize] = i);
        first
    }
}

#[cfg(test)]
mod tests {
    use super::MeanTerm;

    #[test]
    fn means_are_those_of_the_parts() {
        let term = MeanTerm::new(vec![0, 1, 0, 1], vec![1.0, 2.0, 3.0, 2.0], vec![-1.0, 2.0]);
        let mut x = [4.0, 1.0, 8.0, 5.0];
        let mut out = [0.0; 4];
        term.add_to(&x, &mut out);
        assert_eq!(out, [-7.0, 6.0, -7.0, 6.0]);
        assert_eq!(term.subtract_means(&mut x), [7.0, 3.0]);
        assert_eq!((x, term.first_of_parts()), ([-3.0, -2.0, 1.0, 2.0], vec![0, 1]));
    }
}
