//! Signed distances of the particles at the start from the drop, and their velocities.

use super::layer::{distance_from_layer, layer_of};
use super::own_motion::StartMotion;
use super::plan::{DropletScene, RATIO};
use super::room::check_size;
use crate::closest_point::{LevelSurface, Redistancing};
use crate::geometry::block::indices;
use crate::geometry::surfaces::WavyLayer;
use crate::geometry::{Surface, Vector};
use crate::parallel::Interrupt;
use crate::scene::BuildContext;
use crate::scene::cloud;
use crate::scenes::pcp_spec::{PcpContext, PcpSpec};
use crate::scenes::shapes::ShapeSurface;
use crate::schemes::weakly_compressible_sph::Geometry;
use crate::schemes::weakly_compressible_sph::walls::Container;
use crate::spec::Violation;
use rayon::prelude::{IntoParallelRefIterator, ParallelIterator};
use serde_json::{Value, json};
use std::sync::Arc;

/// Number of times that a cell next to a surface is halved: an edge of h/16 leaves an error of 1e-4 of a drop of ten spacings.
const MEASURE_HALVINGS: usize = 4;

/// What tells the level of the drop at the start.
pub(super) enum StartDrop<const D: usize> {
    Layer(WavyLayer),
    Surface(ShapeSurface<D>),
    /// Points from outside.
    Points,
}

impl<const D: usize> DropletScene<D> {
    /// The drop at the start.
    pub(super) fn start_drop(&self, context: &BuildContext) -> Result<StartDrop<D>, Vec<Violation>> {
        if let Some(layer) = layer_of(&self.shape, self.lengths()[0]) {
            return Ok(StartDrop::Layer(layer));
        }
        Ok(self.surface_at_build(context)?.map_or(StartDrop::Points, StartDrop::Surface))
    }

    /// Signed distances of places from the drop at the start.
    pub(super) fn levels_at(
        &self,
        drop: &StartDrop<D>,
        context: &BuildContext,
        positions: &[Vector<D>],
    ) -> Result<Vec<f64>, Vec<Violation>> {
        match drop {
            StartDrop::Points => self.levels_of_points(context, positions).map_err(|found| vec![found]),
            StartDrop::Layer(layer) => Ok(self.levels_of_layer(layer, positions)),
            StartDrop::Surface(surface) => Ok(self.levels(surface.whole.as_ref(), positions)),
        }
    }

    fn levels_of_layer(&self, layer: &WavyLayer, positions: &[Vector<D>]) -> Vec<f64> {
        let period = (!self.room.is_bounded(1)).then_some(self.lengths()[1]);
        positions.iter().map(|x| distance_from_layer(layer, period, x)).collect()
    }

    /// The area or volume of the drop at the start, without what lies behind walls; NaN where it is not known.
    pub(super) fn start_measure(&self, drop: &StartDrop<D>, container: Option<&Container<D>>) -> f64 {
        match drop {
            StartDrop::Points => f64::NAN,
            StartDrop::Layer(layer) if self.room.is_bounded(1) || !self.room.obstacles.is_empty() => {
                self.measure_of(&|at| self.levels_of_layer(layer, at), container)
            }
            StartDrop::Layer(layer) => layer.thickness * self.lengths().product() / self.lengths()[1],
            StartDrop::Surface(ShapeSurface { whole, .. }) => {
                let (low, high) = whole.bounding_box();
                if self.room.cuts(&low, &high) {
                    self.measure_of(&|at| self.levels(whole.as_ref(), at), container)
                } else {
                    whole.area_or_volume()
                }
            }
        }
    }

    /// The area or volume inside of what walls cut, by its signed distances on a grid: cells away from the surface count completely or
    /// not at all, those next to it are halved, and the smallest count by the share below a plane across one axis.
    fn measure_of(&self, levels: &dyn Fn(&[Vector<D>]) -> Vec<f64>, container: Option<&Container<D>>) -> f64 {
        let (low, lengths) = (self.room.low, self.lengths());
        let counts: [usize; D] = std::array::from_fn(|d| (lengths[d] / self.config.spacing).ceil().max(1.0) as usize);
        let mut edges = Vector::<D>::from_fn(|d, _| lengths[d] / counts[d] as f64);
        let place = |k: usize| {
            let cell = indices(k, &counts);
            Vector::<D>::from_fn(|d, _| low[d] + (cell[d] as f64 + 0.5) * edges[d])
        };
        let mut centers: Vec<Vector<D>> = (0..counts.iter().product()).map(place).collect();
        let mut measure = 0.0;
        for halving in 0..=MEASURE_HALVINGS {
            let (volume, half_diagonal) = (edges.product(), 0.5 * edges.norm());
            let mut found = levels(&centers);
            // What lies in bodies is outside.
            let in_front = |x: &Vector<D>| container?.beside_obstacle(x).map(|beside| beside.distance);
            for (level, x) in found.iter_mut().zip(&centers) {
                *level = level.max(in_front(x).map_or(f64::NEG_INFINITY, |distance| -distance));
            }
            let is_last = halving == MEASURE_HALVINGS;
            let share = |level: f64| match level.abs() < half_diagonal {
                true => (0.5 - level / edges.max()).clamp(0.0, 1.0),
                false => f64::from(u8::from(level < 0.0)),
            };
            let counted = found.iter().filter(|level| is_last || level.abs() >= half_diagonal);
            measure += volume * counted.map(|level| share(*level)).sum::<f64>();
            let cut = centers.iter().zip(&found).filter(|(_, level)| level.abs() < half_diagonal).map(|(x, _)| *x);
            edges *= 0.5;
            centers = cut
                .flat_map(|x| (0..1_usize << D).map(move |octant| (x, octant)))
                .map(|(x, octant)| x + Vector::<D>::from_fn(|d, _| edges[d] * ((octant >> d & 1) as f64 - 0.5)))
                .collect();
        }
        measure
    }

    /// The surface of the drop, if it has one; that of a mesh must fit into the box.
    pub(super) fn surface_at_build(&self, context: &BuildContext) -> Result<Option<ShapeSurface<D>>, Vec<Violation>> {
        let room = (0.0, self.spec.spacing);
        let surface = self.shape.surface_at_build(self.surface.as_ref(), &context.clouds, room)?;
        let whole = surface.as_ref().map(|surface| surface.whole.as_ref());
        let corners = self.spec.domain.as_ref();
        let too_large = |whole| check_size(whole, (&self.room, corners?), &self.shape);
        match whole.and_then(too_large) {
            Some(violation) => Err(vec![violation]),
            None => Ok(surface),
        }
    }

    /// Signed distances from the nearest image of a shape.
    pub(super) fn levels(&self, surface: &dyn Surface<D>, positions: &[Vector<D>]) -> Vec<f64> {
        let lengths = self.lengths();
        let (low, high) = surface.bounding_box();
        let images: Vec<Vector<D>> = (0..3_usize.pow(D as u32))
            .map(|image| {
                let turns = Vector::<D>::from_fn(|d, _| (image / 3_usize.pow(d as u32) % 3) as f64 - 1.0);
                turns.component_mul(&lengths)
            })
            // A wall has no images behind it.
            .filter(|image: &Vector<D>| (0..D).all(|d| image[d] == 0.0 || !self.room.is_bounded(d)))
            .collect();
        positions
            .par_iter()
            .map(|x| {
                let mut least = f64::INFINITY;
                for image in &images {
                    let y = x + image;
                    // No point of the shape is nearer than its box.
                    let away = (low - y).sup(&(y - high)).sup(&Vector::<D>::zeros()).norm();
                    if away < least {
                        least = least.min(surface.signed_distance(&y));
                    }
                }
                least
            })
            .collect()
    }

    /// Velocities of the particles at the start.
    pub(super) fn start_velocities(
        &self,
        motion: &StartMotion,
        positions: &[Vector<D>],
        level: &[f64],
    ) -> Result<Vec<Vector<D>>, Vec<Violation>> {
        // Points from outside have no parts.
        let parts: &[Arc<dyn Surface<D>>] = self.surface.as_ref().map_or(&[], |surface| &surface.parts);
        let of_parts: Vec<Vec<f64>> = parts.iter().map(|part| self.levels(part.as_ref(), positions)).collect();
        let nearest =
            |i: usize| (0..of_parts.len()).min_by(|a, b| of_parts[*a][i].total_cmp(&of_parts[*b][i])).unwrap_or(0);
        motion.at(positions, level, nearest).map_err(|found| vec![found])
    }

    /// Signed distances from the surface of points that came from elsewhere.
    pub(super) fn levels_of_points(
        &self,
        context: &BuildContext,
        positions: &[Vector<D>],
    ) -> Result<Vec<f64>, Violation> {
        let (points, level) = cloud::points_with_levels::<D>(&context.clouds, "/shape")?;
        if let Some(found) = cloud::check_spacing(&points, self.config.spacing) {
            return Err(found);
        }
        let domain = self.room.domain();
        let points: Vec<Vector<D>> = points.iter().map(|x| domain.wrap(*x)).collect();
        let method = match &self.config.geometry {
            Geometry::Pcp { method, .. } => method.clone(),
            Geometry::ColorField => {
                let context = PcpContext { pointer: "/geometry", dimension: D, default_ratio: RATIO };
                PcpSpec::default().plan(context)?.0
            }
        };
        let mut surface = LevelSurface::Spatial(Box::new(Redistancing::new(method, domain, self.config.spacing)));
        let never = Interrupt::default();
        let fitted =
            surface.detect(&points, &level, &never).and_then(|()| surface.fit_samples(&points, &level, None, &never));
        if fitted.is_err() || surface.is_lost() {
            let detail = "phi of the points has no zero between them".to_owned();
            return Err(Violation::new("/shape", "data", detail, Value::Null, json!("PointData/phi of both signs")));
        }
        let distance = |x: &Vector<D>| {
            let foot = surface.query(x, f64::INFINITY)?;
            Some(if surface.is_inside(x, &foot) { -foot.distance } else { foot.distance })
        };
        Ok(positions.par_iter().map(|x| distance(x).unwrap_or(f64::INFINITY)).collect())
    }
}
