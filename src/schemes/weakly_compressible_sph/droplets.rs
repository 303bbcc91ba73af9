//! Droplets: the connected components of the fluid inside, and the curvature that each would have as a ball.

use super::species::Species;
use super::walls::Container;
use crate::geometry::{Domain, Vector};
use crate::neighbors::{CellList, NeighborSearch};
use std::f64::consts::PI;

/// Constants of the count.
struct Tuning {
    /// Particles of the fluid inside at most this distance apart, in h, belong to one droplet: on a lattice the eight next
    /// particles in the plane.
    link: f64,
    /// Particles of the smallest droplet in the plane and in space. Smaller components are fragments.
    smallest: [usize; 2],
    /// The most droplets that are told apart, since a label is one byte; further components count as fragments.
    most: usize,
    /// Distance from a wall, in h, within which a particle touches it.
    contact: f64,
}

const TUNING: Tuning = Tuning { link: 1.5, smallest: [12, 40], most: 250, contact: 1.0 };

/// The label of particles that belong to no droplet: fragments, and particles far from any droplet.
pub(super) const FRAGMENT: u8 = u8::MAX;

/// The droplets, by particle and by droplet.
#[derive(Debug)]
pub(super) struct Droplets<const D: usize> {
    components: Components<D>,
    /// The droplet of each particle, where there are several.
    pub label: Vec<u8>,
    /// The curvature κ₀ of each droplet as a ball.
    pub ball_curvatures: Vec<f64>,
    /// Particles of each droplet when their number last changed.
    sizes: Vec<usize>,
    /// Whether each is a layer: it reaches across the box and has no curvature as a ball.
    is_layer: Vec<bool>,
    /// The contact angle of each that touches a wall.
    contacts: Vec<Option<f64>>,
    /// The area or volume that was enclosed at the start.
    pub initial_measure: f64,
}

/// Particles to look for droplets in.
#[derive(Debug, Clone, Copy)]
pub(super) struct Searched<'a, const D: usize> {
    pub positions: &'a [Vector<D>],
    pub species: &'a [Species],
    /// Particles that take the label of the nearest droplet.
    pub near: &'a [usize],
    /// The spacing h.
    pub spacing: f64,
    /// Distance up to which a particle takes the label of a droplet.
    pub cutoff: f64,
    pub container: Option<&'a Container<D>>,
}

impl<const D: usize> Droplets<D> {
    /// No droplets counted yet, among `count` particles.
    pub fn new(domain: Domain<D>, count: usize, initial_measure: f64) -> Self {
        Self {
            components: Components::new(domain),
            label: vec![FRAGMENT; count],
            ball_curvatures: Vec::new(),
            sizes: Vec::new(),
            is_layer: Vec::new(),
            contacts: Vec::new(),
            initial_measure,
        }
    }

    /// Replaces the domain, before droplets are counted.
    pub fn set_domain(&mut self, domain: &Domain<D>) {
        self.components.cells.set_domain(domain);
    }

    /// The number of droplets.
    pub fn number(&self) -> usize {
        self.ball_curvatures.len()
    }

    /// Counts the droplets. Returns their number where it changed; each then gets the curvature of a ball of its share of the
    /// measure that was enclosed at the start.
    pub fn count(&mut self, searched: &Searched<'_, D>) -> Option<usize> {
        let (sizes, is_layer) = self.components.find(searched, &mut self.label);
        let (sizes, is_layer) = (sizes.to_vec(), is_layer.to_vec());
        let contacts = self.find_contacts(searched, sizes.len());
        let before = self.number();
        let were_layers = self.ball_curvatures.iter().map(|kappa| *kappa == 0.0);
        let is_same = sizes.len() == before && were_layers.eq(is_layer.iter().copied());
        if is_same && contacts == self.contacts {
            return None;
        }
        let is_touching = is_same && !self.contacts.is_empty();
        (self.sizes, self.is_layer, self.contacts) = (sizes, is_layer, contacts);
        self.renew_ball_curvatures();
        // A drop that comes to a wall or leaves it stays one.
        (!is_touching).then(|| self.number())
    }

    /// The contact angles of droplets that touch a wall; empty without walls.
    fn find_contacts(&self, searched: &Searched<'_, D>, droplets: usize) -> Vec<Option<f64>> {
        let Some(container) = searched.container else { return Vec::new() };
        let mut contacts = vec![None; droplets];
        for i in self.components.inside.iter().copied() {
            let Some(contact) = contacts.get_mut(usize::from(self.label[i])) else { continue };
            let beside = container.beside(&searched.positions[i]);
            if let Some(beside) = beside.filter(|beside| beside.distance < TUNING.contact * searched.spacing) {
                *contact = Some(container.wall(beside.wall).contact.mean());
            }
        }
        contacts
    }

    /// Whether the droplet that a particle belongs to touches a wall.
    pub fn is_at_wall(&self, i: usize) -> bool {
        let droplet = if self.number() > 1 { usize::from(self.label[i]) } else { 0 };
        self.contacts.get(droplet).is_some_and(Option::is_some)
    }

    /// The contact angles for a checkpoint; −1 for a droplet at no wall.
    pub fn saved_contacts(&self) -> Vec<f64> {
        self.contacts.iter().map(|angle| angle.unwrap_or(-1.0)).collect()
    }

    /// Loads what [`Self::saved_contacts`] gave.
    pub fn load_contacts(&mut self, saved: &[f64]) {
        self.contacts = saved.iter().map(|angle| (*angle >= 0.0).then_some(*angle)).collect();
    }

    /// The contact angle of the droplets that touch a wall, where it is one.
    pub fn contact_angle(&self) -> Option<f64> {
        let mut angles = self.contacts.iter().flatten();
        let first = *angles.next()?;
        angles.all(|angle| *angle == first).then_some(first)
    }

    /// Whether any droplet touches a wall.
    pub fn has_contact(&self) -> bool {
        self.contacts.iter().any(Option::is_some)
    }

    /// Sets κ₀ of each droplet to that of its share of the measure that was enclosed at the start.
    pub fn renew_ball_curvatures(&mut self) {
        let all = self.sizes.iter().sum::<usize>().max(1) as f64;
        self.ball_curvatures.clear();
        let share = |(k, (size, is_layer)): (usize, (&usize, &bool))| {
            let measure = self.initial_measure * *size as f64 / all;
            match (is_layer, self.contacts.get(k).copied().flatten()) {
                (true, _) => 0.0,
                (false, None) => ball_curvature::<D>(measure),
                (false, Some(angle)) => cap_curvature::<D>(measure, angle),
            }
        };
        self.ball_curvatures.extend(self.sizes.iter().zip(&self.is_layer).enumerate().map(share));
    }

    /// Number of groups that sums over droplets have: one, or one for each label where there are several.
    pub fn groups(&self) -> usize {
        if self.number() > 1 { usize::from(u8::MAX) + 1 } else { 1 }
    }

    /// The group that a particle belongs to.
    pub fn group(&self, i: usize) -> usize {
        if self.number() > 1 { usize::from(self.label[i]) } else { 0 }
    }

    /// Whether a particle belongs to or lies next to a fragment, as the last count has it; none where there is one droplet.
    pub fn is_fragment(&self, i: usize) -> bool {
        self.number() > 1 && self.label[i] == FRAGMENT
    }

    /// Whether a component reaches across the box: a layer, or a fluid with holes.
    pub fn has_layer(&self) -> bool {
        self.ball_curvatures.contains(&0.0)
    }

    /// The curvature κ₀ of the droplet that a particle belongs to.
    pub fn ball_curvature(&self, i: usize) -> f64 {
        match self.ball_curvatures.as_slice() {
            [only] => *only,
            several => several.get(self.label[i] as usize).copied().unwrap_or(0.0),
        }
    }
}

/// Storage for finding connected components.
#[derive(Debug)]
struct Components<const D: usize> {
    cells: CellList<D>,
    inside: Vec<usize>,
    component: Vec<usize>,
    stack: Vec<usize>,
    /// Position of each particle inside, from the first of its component along links.
    offset: Vec<Vector<D>>,
    sizes: Vec<usize>,
    /// Whether each component links with its own image.
    is_layer: Vec<bool>,
    ranks: Vec<usize>,
}

impl<const D: usize> Components<D> {
    fn new(domain: Domain<D>) -> Self {
        Self {
            cells: CellList::new(domain),
            inside: Vec::new(),
            component: Vec::new(),
            stack: Vec::new(),
            offset: Vec::new(),
            sizes: Vec::new(),
            is_layer: Vec::new(),
            ranks: Vec::new(),
        }
    }

    /// Labels the particles of the fluid inside and, of the others, those near a droplet. Droplets count from 0 by their first
    /// particle. Returns the number of particles of each droplet, and whether it is a layer.
    fn find(&mut self, searched: &Searched<'_, D>, label: &mut [u8]) -> (&[usize], &[bool]) {
        self.inside.clear();
        let species = searched.species;
        self.inside.extend((0..searched.positions.len()).filter(|i| species[*i] == Species::Inside));
        self.connect(searched);
        let droplets = self.rank();
        label.fill(FRAGMENT);
        for (k, i) in self.inside.iter().enumerate() {
            label[*i] = self.ranks[self.component[k]] as u8;
        }
        if droplets > 1 {
            for i in searched.near.iter().copied().filter(|i| species[*i] != Species::Inside) {
                if let Some((k, _)) = self.cells.nearest(&searched.positions[i], searched.cutoff) {
                    label[i] = self.ranks[self.component[k]] as u8;
                }
            }
        }
        let is_droplet = |rank: Option<&usize>| rank.is_some_and(|rank| *rank != usize::from(FRAGMENT));
        let mut rank = self.ranks.iter();
        self.sizes.retain(|_| is_droplet(rank.next()));
        let mut rank = self.ranks.iter();
        self.is_layer.retain(|_| is_droplet(rank.next()));
        (&self.sizes, &self.is_layer)
    }

    /// Numbers the connected components of the fluid inside and counts their particles.
    fn connect(&mut self, searched: &Searched<'_, D>) {
        let (positions, link) = (searched.positions, TUNING.link * searched.spacing);
        self.cells.rebuild(self.inside.iter().map(|i| positions[*i]), link);
        self.component.clear();
        self.component.resize(self.inside.len(), usize::MAX);
        self.sizes.clear();
        self.is_layer.clear();
        self.offset.clear();
        self.offset.resize(self.inside.len(), Vector::<D>::zeros());
        for seed in 0..self.inside.len() {
            if self.component[seed] != usize::MAX {
                continue;
            }
            let name = self.sizes.len();
            let (mut size, mut is_layer) = (0, false);
            self.component[seed] = name;
            self.stack.push(seed);
            while let Some(k) = self.stack.pop() {
                size += 1;
                let (component, stack, offset) = (&mut self.component, &mut self.stack, &mut self.offset);
                self.cells.for_each_within(&positions[self.inside[k]], link, |other, dx, _| {
                    let place = offset[k] + dx;
                    if component[other] == usize::MAX {
                        component[other] = name;
                        offset[other] = place;
                        stack.push(other);
                    } else {
                        // Two ways to one particle that differ by a period.
                        is_layer |= (place - offset[other]).norm() > link;
                    }
                });
            }
            self.sizes.push(size);
            self.is_layer.push(is_layer);
        }
    }

    /// Tells droplets from fragments. Returns the number of droplets.
    fn rank(&mut self) -> usize {
        let smallest = TUNING.smallest[usize::from(D != 2)];
        self.ranks.clear();
        let mut droplets = 0;
        for size in &self.sizes {
            let is_droplet = *size >= smallest && droplets < TUNING.most;
            self.ranks.push(if is_droplet { droplets } else { usize::from(FRAGMENT) });
            droplets += usize::from(is_droplet);
        }
        droplets
    }
}

/// The curvature of a ball of a given area or volume: √(π/A), 2 (4π/3V)^⅓.
#[must_use]
pub fn ball_curvature<const D: usize>(measure: f64) -> f64 {
    if D == 2 { (PI / measure).sqrt() } else { 2.0 * (4.0 * PI / (3.0 * measure)).cbrt() }
}

/// The least angle for which a cap is curved: a film on a wall has no curvature.
const LEAST_ANGLE: f64 = 0.1;

/// The curvature of a cap of a given area or volume that meets a wall at an angle: the ball's times a root of the share of the ball
/// that the cap is, (θ − sin θ cos θ)/π in the plane and (2 + cos θ)(1 − cos θ)²/4 in space.
fn cap_curvature<const D: usize>(measure: f64, angle: f64) -> f64 {
    let angle = angle.clamp(LEAST_ANGLE, PI);
    let (sine, cosine) = angle.sin_cos();
    let share =
        if D == 2 { (angle - sine * cosine) / PI } else { 0.25 * (2.0 + cosine) * (1.0 - cosine) * (1.0 - cosine) };
    ball_curvature::<D>(measure) * share.powf(1.0 / D as f64)
}

#[cfg(test)]
mod tests {
    use super::{Domain, Droplets, FRAGMENT, Searched, Species, Vector, ball_curvature, cap_curvature};
    use crate::geometry::domain::Axis;

    #[test]
    fn droplets_across_the_edge_are_one_and_fragments_are_none() {
        let domain = Domain::new([Axis::Periodic { start: 0.0, length: 20.0 }; 2]);
        let positions: Vec<Vector<2>> =
            (0..400).map(|k| Vector::<2>::new(f64::from(k % 20) + 0.5, f64::from(k / 20) + 0.5)).collect();
        let near = |x: &Vector<2>, c: [f64; 2], r: f64| domain.displacement(&Vector::<2>::from(c), x).norm() < r;
        let is_inside =
            |x: &Vector<2>| near(x, [0.0, 10.0], 4.0) || near(x, [10.0, 10.0], 3.0) || near(x, [10.5, 2.5], 0.9);
        let species: Vec<Species> =
            positions.iter().map(|x| if is_inside(x) { Species::Inside } else { Species::Outside }).collect();
        let all: Vec<usize> = (0..400).collect();
        let mut droplets = Droplets::new(domain.clone(), 400, 30.0);
        let searched = Searched {
            positions: &positions,
            species: &species,
            near: &all,
            spacing: 1.0,
            cutoff: 3.0,
            container: None,
        };
        assert_eq!(droplets.count(&searched), Some(2));
        assert_eq!(droplets.count(&searched), None, "their number has not changed");
        let at = |x: usize, y: usize| droplets.label[x + 20 * y];
        assert_eq!(at(0, 10), at(19, 10));
        assert_ne!(at(0, 10), at(10, 10));
        assert_eq!(at(10, 2), FRAGMENT);
        assert_eq!(at(13, 10), at(10, 10));
        // Each has the curvature of its share of the measure.
        let shares: f64 = droplets.ball_curvatures.iter().map(|kappa| std::f64::consts::PI / (kappa * kappa)).sum();
        assert!((shares - 30.0).abs() < 1e-12);
        assert!(droplets.ball_curvature(200) < droplets.ball_curvature(210), "the larger droplet is less curved");
    }

    #[test]
    fn a_layer_has_no_curvature_and_leaves_a_drop_its_share() {
        let domain = Domain::new([Axis::Periodic { start: 0.0, length: 20.0 }; 2]);
        let positions: Vec<Vector<2>> =
            (0..400).map(|k| Vector::<2>::new(f64::from(k % 20) + 0.5, f64::from(k / 20) + 0.5)).collect();
        let all: Vec<usize> = (0..400).collect();
        let is_drop = |x: &Vector<2>| (x - Vector::<2>::new(10.0, 13.0)).norm() < 3.0;
        let by = |is_inside: &dyn Fn(&Vector<2>) -> bool| -> Vec<Species> {
            positions.iter().map(|x| if is_inside(x) { Species::Inside } else { Species::Outside }).collect()
        };
        let pool = by(&|x| x[1] < 5.0 || is_drop(x));
        let inside = pool.iter().filter(|species| **species == Species::Inside).count();
        let mut droplets = Droplets::new(domain, 400, inside as f64);
        let searched = |species| Searched {
            positions: &positions,
            species,
            near: &all,
            spacing: 1.0,
            cutoff: 3.0,
            container: None,
        };
        assert_eq!(droplets.count(&searched(&pool)), Some(2));
        assert!(droplets.has_layer() && droplets.ball_curvatures[0] == 0.0);
        // The drop has the curvature of its own particles.
        let expected = ball_curvature::<2>((inside - 100) as f64);
        assert!((droplets.ball_curvatures[1] - expected).abs() < 1e-12);
        // The same number of components, but the drop has become a second layer.
        let layers = by(&|x| x[1] < 5.0 || (x[1] - 13.0).abs() < 1.0);
        assert_eq!(droplets.count(&searched(&layers)), Some(2), "a layer is no drop");
        assert!(droplets.ball_curvatures.iter().all(|kappa| *kappa == 0.0));
    }

    #[test]
    fn caps_have_the_curvature_of_their_angle() {
        let pi = std::f64::consts::PI;
        // Half a disk and half a ball of radius 2, and whole ones.
        assert!((cap_curvature::<2>(2.0 * pi, 0.5 * pi) - 0.5).abs() < 1e-14);
        assert!((cap_curvature::<3>(16.0 / 3.0 * pi, 0.5 * pi) - 1.0).abs() < 1e-14);
        assert!((cap_curvature::<3>(32.0 / 3.0 * pi, pi) - 1.0).abs() < 1e-14);
    }

    #[test]
    fn balls_have_their_curvature() {
        assert!((ball_curvature::<2>(std::f64::consts::PI * 0.25) - 2.0).abs() < 1e-14);
        assert!((ball_curvature::<3>(4.0 / 3.0 * std::f64::consts::PI * 0.125) - 4.0).abs() < 1e-14);
    }
}
