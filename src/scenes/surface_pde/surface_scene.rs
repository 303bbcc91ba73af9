//! A planned `surface_pde` scene: its estimates, and the simulation that it builds.

use super::data_fields;
use super::methods::Scheme;
use super::plan::{Normals, SurfaceScene};
use super::points;
use super::problems::ProblemChoice;
use super::simulations::{self, Run};
use super::spec::MethodSpec;
use super::surfaces::{self, Shape};
use crate::geometry::random::CounterRandom;
use crate::geometry::{Surface, Vector};
use crate::parallel::Interrupt;
use crate::point_clouds::normals;
use crate::point_clouds::preparation::spacings_and_graph;
use crate::scene::cloud::{CloudReference, CloudSizes, Clouds};
use crate::scene::work::PhaseWork;
use crate::scene::{self, BuildContext, Estimate, Scene, View};
use crate::scenes::work_estimate;
use crate::schemes::embedding_closest_point::{EmbeddingClosestPoint, EmbeddingParts, SurfaceData};
use crate::schemes::surface_equation::quantities::{CURVATURE, NORMAL, VALUE};
use crate::schemes::surface_equation::{Form, Method, SurfaceCloud};
use crate::simulation::fields::COMMON_FIELDS;
use crate::simulation::{CpuClock, OutputPlan, Quantity, Region, Simulation};
use crate::spec::Violation;
use serde_json::{Value, json};

impl SurfaceScene {
    /// Entries of a row, about.
    fn entries(&self, method: &Method) -> f64 {
        let cutoff = method.support.radius / self.shape.spacing(self.count);
        let is_curve = self.shape.is_curve();
        1.0 + if is_curve { 2.0 * cutoff } else { std::f64::consts::PI * cutoff * cutoff }
    }

    /// Nodes of a fit, about.
    fn nodes(&self, method: &Method) -> f64 {
        let surface = self.entries(method);
        match method.form {
            Form::Intrinsic { .. } => surface,
            // Walks, stars and normals take about as long as a fit of twice as many nodes.
            Form::Stars { .. } => 3.0 * surface,
            Form::Conservative => 0.5 * surface,
            Form::Copies { layers, .. } => surface * (1.0 + 1.6 * f64::from(layers)),
        }
    }

    /// Steps of an integrator to one of the scene, when stability binds them.
    fn inner_steps(&self, count: u64) -> f64 {
        self.problem.inner_steps(self.fixed.time_step, self.shape.spacing(count), self.shape.reach())
    }

    /// Functions of a fit.
    fn terms(&self, method: &Method) -> f64 {
        let n = method.support.degree as f64;
        let is_curve = self.shape.is_curve();
        let coordinates = if is_curve { 1 } else { 2 } + usize::from(matches!(method.form, Form::Copies { .. }));
        match coordinates {
            1 => n,
            2 => (n + 1.0) * (n + 2.0) / 2.0 - 1.0,
            _ => (n + 1.0) * (n + 2.0) * (n + 3.0) / 6.0 - 1.0,
        }
    }

    fn run(&self, interrupt: Interrupt, cpu_clock: CpuClock, clouds: Clouds) -> Run {
        Run { seed: self.spec.seed, fixed: self.fixed, interrupt, cpu_clock, clouds }
    }

    /// The cloud with the normals that operators are made with, and with data.
    fn cloud<const D: usize>(
        &self,
        mut cloud: SurfaceCloud<D>,
        radius: f64,
        clouds: &Clouds,
    ) -> Result<SurfaceCloud<D>, Vec<Violation>> {
        let rows: Vec<usize> = (0..cloud.rows).collect();
        cloud.data = data_fields::values(&self.spec, clouds, None, &rows)?;
        match self.normals {
            Normals::Exact | Normals::Given { .. } => {}
            Normals::Perturbed { sigma } => {
                let random = CounterRandom::new(self.spec.seed ^ 0x6e6f_726d);
                for (i, normal) in cloud.normals[..cloud.rows].iter_mut().enumerate() {
                    let off = Vector::<D>::from_fn(|d, _| sigma * random.symmetric(&[i as i64, d as i64]));
                    *normal = (*normal + off).normalize();
                }
            }
            Normals::Estimated => {
                let found = normals::estimate::<D>(&cloud.points, radius);
                let found = found.map_err(|failed| {
                    let refused = Violation::new("/normals", "data", failed.to_string(), "estimated", Value::Null);
                    vec![refused]
                })?;
                cloud.normals = found;
            }
        }
        if let Scheme::Dcpse(Method { form: Form::Stars { .. } | Form::Conservative, .. }) = self.scheme {
            (cloud.spacings, cloud.graph) = spacings_and_graph(&cloud.points, &cloud.normals);
            // What the operator keeps is measured with its own areas.
            cloud.areas = Some(cloud.graph.areas.clone());
        }
        Ok(cloud)
    }
}

impl Scene for SurfaceScene {
    fn kind(&self) -> &'static str {
        super::KIND.kind
    }

    fn dimension(&self) -> usize {
        self.shape.dimension()
    }

    fn spacing(&self) -> Option<f64> {
        self.points.is_none().then(|| self.shape.spacing(self.count))
    }

    fn size(&self) -> Option<f64> {
        self.points.is_none().then(|| self.shape.size())
    }

    fn choices(&self) -> Vec<(&'static str, Vec<Value>)> {
        let of_order = |order: u64| json!({"type": "surface_dcpse", "order": order});
        let is_exact = self.points.is_none() && matches!(self.normals, Normals::Exact);
        if is_exact { vec![("/method", [2, 4, 6].map(of_order).to_vec())] } else { Vec::new() }
    }

    fn order(&self, quantity: &str, _norm: &str) -> Option<f64> {
        let order = match self.spec.method.as_ref()? {
            MethodSpec::SurfaceDcpse { order, .. } | MethodSpec::ClosestPoint { order, .. } => *order as f64,
            MethodSpec::Conservative => 2.0,
            MethodSpec::Auto { .. } => return None,
        };
        // First derivatives gain an order over second ones.
        let order = match quantity {
            "value" => order,
            "gradient" => order + 1.0,
            _ => return None,
        };
        matches!(self.normals, Normals::Exact).then_some(order)
    }

    fn resolved(&self) -> Value {
        scene::resolved(super::KIND.kind, &self.spec)
    }

    fn view(&self) -> View {
        let fields = self.problem.fields(&self.shape);
        let shown = fields.iter().find(|field| ***field == VALUE).or(fields.first());
        shown.map_or(View::Nothing, |field| View::SurfaceField {
            field: field.name,
            normal: "normal",
            is_plane: self.shape.is_curve(),
        })
    }

    fn fields(&self) -> Vec<&'static Quantity> {
        let mut fields = self.problem.fields(&self.shape);
        fields.push(&NORMAL);
        fields.extend(COMMON_FIELDS);
        if self.points.is_none() && !matches!(self.problem, ProblemChoice::Moving { .. }) {
            fields.push(&CURVATURE);
        }
        fields
    }

    fn operator_entries(&self, estimate: &Estimate) -> f64 {
        match &self.scheme {
            Scheme::Dcpse(method) => {
                // A point has six neighbors in the conservative form.
                let entries = if method.form == Form::Conservative { 7.0 } else { self.entries(method) };
                estimate.particles as f64 * entries * self.problem.operators(self.shape.dimension())
            }
            Scheme::Embedding { .. } => 0.0,
        }
    }

    fn regions(&self) -> Vec<Region> {
        vec![Region::Surface, Region::All]
    }

    fn clouds(&self) -> Vec<CloudReference> {
        self.clouds.clone()
    }

    fn check_sizes(&self, sizes: &CloudSizes) -> Vec<Violation> {
        data_fields::check_sizes(&self.clouds, sizes)
    }

    fn estimate(&self, sizes: &CloudSizes) -> Estimate {
        let particles = sizes.get("/surface").map_or_else(|| self.shape.points(self.count), |size| size.points);
        let points = particles as f64;
        let memory = match &self.scheme {
            // Points, normals, columns; entries once in the rows of the tasks and once in those of the operator.
            Scheme::Dcpse(method) => {
                let entries = self.entries(method);
                // Neighbors, stars and their graph, triangles.
                let stars = if let Form::Stars { .. } | Form::Conservative = method.form { 850.0 } else { 0.0 };
                points
                    * (250.0
                        + stars
                        + 2.4 * 12.0 * entries * self.problem.copies()
                        + self.problem.fill(entries, points))
            }
            Scheme::Embedding { order, spacing } => {
                let area = points * self.shape.spacing(self.count).powi(2);
                let bounds = self.shape.in_space().map(Surface::bounding_box);
                points * 250.0 + bounds.map_or(0.0, |bounds| EmbeddingParts::memory(*order, *spacing, area, bounds))
            }
        };
        Estimate {
            particles,
            steps: self.fixed.steps,
            time_step: self.fixed.time_step,
            end_time: self.fixed.clock(self.fixed.steps).time,
            memory_bytes: memory as u64,
        }
    }

    fn family(&self) -> String {
        let dimension = self.shape.dimension();
        let problem = self.problem.name();
        match &self.scheme {
            Scheme::Dcpse(Method { support, form: Form::Intrinsic { .. } }) => {
                format!("surface_pde/{dimension}/intrinsic/{}/{problem}", support.degree)
            }
            Scheme::Dcpse(Method { support, form: Form::Stars { .. } }) => {
                format!("surface_pde/{dimension}/stars/{}/{problem}", support.degree)
            }
            Scheme::Dcpse(Method { form: Form::Conservative, .. }) => {
                format!("surface_pde/{dimension}/conservative/{problem}")
            }
            Scheme::Dcpse(Method { support, .. }) => {
                format!("surface_pde/{dimension}/copies/{}/{problem}", support.degree)
            }
            Scheme::Embedding { order, .. } => format!("surface_pde/{dimension}/embedding/{order}"),
        }
    }

    fn work(&self, estimate: &Estimate, plan: &OutputPlan) -> Vec<PhaseWork> {
        let Estimate { particles, steps, end_time, .. } = *estimate;
        let points = particles as f64;
        let mut work = match &self.scheme {
            Scheme::Dcpse(method) => {
                let (nodes, terms) = (self.nodes(method), self.terms(method));
                let fit = nodes * (20.0 + 0.25 * terms * terms) + 0.02 * terms.powi(3);
                let application = points * self.entries(method);
                let mut work = vec![PhaseWork::at_milestones("operators/construction", points * fit)];
                work.extend(self.problem.work(application, points, steps as f64, self.inner_steps(particles)));
                work
            }
            Scheme::Embedding { order, spacing } => {
                let band = 2.0 * EmbeddingParts::half_band(*order) * (self.shape.spacing(self.count) / spacing).powi(2);
                let stencil = (*order as f64 + 2.0).powi(3);
                vec![
                    PhaseWork::at_milestones("operators/construction", points * band * (200.0 + stencil)),
                    PhaseWork::every_step("operators/application", points * band * stencil * steps as f64),
                ]
            }
        };
        work.extend(work_estimate::around(points, steps, end_time, plan));
        work
    }

    fn build(&self, context: BuildContext) -> Result<Box<dyn Simulation>, Vec<Violation>> {
        if let Shape::Points(_) = self.shape {
            return if self.shape.is_curve() {
                points::build::<2, 1>(self, context)
            } else {
                points::build::<3, 2>(self, context)
            };
        }
        let BuildContext { interrupt, cpu_clock, clouds, .. } = context;
        match (&self.scheme, &self.shape) {
            (Scheme::Dcpse(method), Shape::Circle { radius }) => {
                let cloud = surfaces::circle(*radius, self.count as usize, self.sampling, self.spec.seed);
                let cloud = self.cloud(cloud, method.support.radius, &clouds)?;
                simulations::build::<2, 1>(
                    &self.problem,
                    (&self.shape, cloud, *method),
                    self.run(interrupt, cpu_clock, clouds),
                    None,
                )
            }
            (Scheme::Dcpse(method), shape) => {
                let reach = method.support.radius;
                let cloud = surfaces::in_space(shape, self.count, self.sampling, self.spec.seed, reach, &interrupt);
                let cloud = self.cloud(cloud, reach, &clouds)?;
                simulations::build::<3, 2>(
                    &self.problem,
                    (shape, cloud, *method),
                    self.run(interrupt, cpu_clock, clouds),
                    None,
                )
            }
            (Scheme::Embedding { order, spacing }, shape) => {
                let cloud = surfaces::in_space(shape, self.count, self.sampling, self.spec.seed, 0.0, &interrupt);
                let Some((field, values, operated)) = self.problem.known(shape, &cloud) else { return Err(Vec::new()) };
                let surface: Box<dyn Surface<3>> = match shape {
                    Shape::Torus(torus) => Box::new(torus.clone()),
                    Shape::Ellipsoid(ellipsoid) => Box::new(ellipsoid.clone()),
                    Shape::Circle { .. } | Shape::Bump(_) | Shape::Points(_) => return Err(Vec::new()),
                };
                let parts = EmbeddingParts { order: *order, spacing: *spacing, repeats: self.fixed.steps };
                let SurfaceCloud { points, normals, curvatures, .. } = cloud;
                let data = SurfaceData { points, normals, curvatures, field: values, reference: operated };
                let field = Box::new(move |x: &Vector<3>| field.value(x));
                Ok(Box::new(EmbeddingClosestPoint::new(surface, field, data, parts, interrupt, cpu_clock)))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::parallel::Interrupt;
    use crate::scene::{self, BuildContext, Clouds};
    use crate::simulation::{CpuClock, OutputPlan};
    use serde_json::json;

    #[test]
    fn the_conservative_form_keeps_the_integral_on_even_points() {
        let start = json!({"type": "truncated_gaussian", "center": [0, 0, 1], "sigma": 1});
        let problem =
            json!({"type": "diffusion", "initial": start, "end_time": 0.1, "time_step": 0.02, "integrator": "bdf2"});
        let body = json!({"kind": "surface_pde", "count": 400, "sampling": "fibonacci", "method": "conservative",
            "solver": "cg", "problem": problem});
        let scene = scene::parse(&body, crate::scenes::SCENES).map_err(|errors| format!("{errors:?}")).unwrap();
        let plan = OutputPlan { every_time: None, series_every_steps: 1 };
        let (interrupt, cpu_clock) = (Interrupt::default(), CpuClock::still());
        let built = scene.build(BuildContext { plan, interrupt, cpu_clock, clouds: Clouds::default() });
        let mut simulation = built.map_err(|errors| format!("{errors:?}")).unwrap();
        while !simulation.is_finished() {
            simulation.step().unwrap();
        }
        let report = simulation.report();
        let mass = report.errors.iter().find(|error| error.quantity == "mass").unwrap();
        assert!(mass.value < 1e-13, "{}", mass.value);
    }
}
