//! What the preparation of points from outside found, as findings, marks and counts.

use crate::point_clouds::PreparedCloud;
use crate::point_clouds::examination::PointList;
use crate::simulation::{Diagnostic, Finding, Mark};

/// Findings, marks and counts of a prepared cloud.
pub(super) struct Preparation {
    pub findings: Vec<Finding>,
    pub marks: Vec<Mark>,
    pub counted: Vec<Diagnostic>,
}

/// Parts with fewer points are no surface.
const SMALL_PART: usize = 12;
/// Time and step of what is known before the first step.
const START: (u64, f64) = (0, 0.0);

impl Preparation {
    /// Collects what was found. At edges an equation has its natural condition, while values at points are one-sided.
    /// `held` points of edges hold a value. The file had `without_face` points more.
    pub fn new<const D: usize>(cloud: &PreparedCloud<D>, is_equation: bool, held: usize, without_face: u64) -> Self {
        let mut found = Self { findings: Vec::new(), marks: Vec::new(), counted: Vec::new() };
        if without_face > 0 {
            let message = format!(
                "{without_face} points of the file were left out, since no face has them; numbers of points do not count them"
            );
            found.findings.push(Finding::info("points.without_face", message, START).with_count(without_face));
        }
        found.left_out(cloud);
        found.edges(cloud, is_equation, held);
        found.normals(cloud);
        found.parts(cloud);
        found
    }

    /// Duplicates and strays. They are in no frame, so that the message alone names them.
    fn left_out<const D: usize>(&mut self, cloud: &PreparedCloud<D>) {
        let mut tell = |code: &'static str, list: &Option<PointList>, detail: &str| {
            let Some(list) = list else { return };
            self.findings.push(Finding::info(code, format!("{list}: {detail}"), START).with_count(list.count as u64));
        };
        tell("points.merged", &cloud.merged, "left out, since each lies where a point before it does");
        tell("points.dropped", &cloud.dropped, "left out, since each lies far from all others");
        let count = |list: &Option<PointList>| list.as_ref().map_or(0, |list| list.count as u64);
        self.counted.extend([
            Diagnostic::count(
                "points.merged",
                count(&cloud.merged),
                "Points left out because another lies at their place.",
            ),
            Diagnostic::count(
                "points.dropped",
                count(&cloud.dropped),
                "Points left out because they lie far from all others.",
            ),
        ]);
    }

    fn edges<const D: usize>(&mut self, cloud: &PreparedCloud<D>, is_equation: bool, held: usize) {
        let open = PointList::from_condition(cloud.points.len(), |i| cloud.graph.is_open(i));
        self.counted.push(Diagnostic::count(
            "stars.open",
            open.as_ref().map_or(0, |list| list.count as u64),
            "Points whose cell is open, as at an edge.",
        ));
        let Some(open) = open else { return };
        let mut detail = "neighbors on one side alone, so the surface has a hole or an edge there".to_owned();
        if is_equation && held == 0 {
            detail += "; nothing flows through it";
        } else if is_equation {
            detail += &format!("; {held} points of it hold a value, and nothing flows through the other ones");
        }
        let finding = if is_equation { Finding::info } else { Finding::warning };
        self.about(&open, finding("holes", format!("{}: {detail}", in_file(cloud, &open)), START));
    }

    fn normals<const D: usize>(&mut self, cloud: &PreparedCloud<D>) {
        if let Some(sheets) = &cloud.joined_sheets {
            let detail =
                "neighbors lie on another sheet of the surface, which is too close or bends too sharply for the points";
            let message = format!("{}: {detail}", in_file(cloud, sheets));
            let advice = "more points, fewer than half the distance of the sheets apart, help";
            self.about(sheets, Finding::warning("close_sheets", message, START).with_advice(advice));
        }
        if cloud.closed_pieces > cloud.graph.part_count {
            let message = format!(
                "{} closed bodies touch, so that the surface has {} parts only",
                cloud.closed_pieces, cloud.graph.part_count
            );
            let advice = "where they touch, results mean nothing; more points, or more distance, tell the bodies apart";
            self.findings.push(Finding::warning("close_sheets", message, START).with_advice(advice));
        }
        let mut replaced = 0;
        if let Some(verdict) = &cloud.verdict {
            if verdict.is_wrong_together {
                replaced = cloud.points.len();
                let message = format!(
                    "{:.1} % of the normals at flat points are off by more than 60°, so all are replaced by estimated ones",
                    100.0 * verdict.wrong_share
                );
                let finding = Finding::warning("normals.wrong_together", message, START).with_count(replaced as u64);
                self.findings.push(finding.with_advice("axes may be exchanged, or the columns may not be normals"));
            } else if let Some(list) = &verdict.replaced {
                replaced = list.count;
                let detail = "the normal opposes those of most neighbors, or does not stand on the surface; another takes its place";
                let message = format!("{}: {detail}", in_file(cloud, list));
                self.about(list, Finding::warning("inconsistent_normals", message, START));
            }
            if verdict.is_unchecked() {
                let message =
                    "too few points lie on a smooth surface to check the given normals, which are used as they are";
                let finding = Finding::warning("normals.unchecked", message.to_owned(), START);
                self.findings.push(finding.with_advice("more points, or smoother ones, help"));
            }
            if verdict.is_turned_anew {
                let message = "many neighbors have normals to different sides, so all sides were found anew".to_owned();
                self.findings.push(Finding::warning("normals.turned", message, START));
            }
        }
        let doc = "Given normals that others took the place of.";
        self.counted.push(Diagnostic::count("normals.replaced", replaced as u64, doc));
    }

    fn parts<const D: usize>(&mut self, cloud: &PreparedCloud<D>) {
        let graph = &cloud.graph;
        let sizes = graph.part_sizes();
        let small = PointList::from_condition(cloud.points.len(), |i| sizes[graph.parts[i] as usize] < SMALL_PART);
        if let Some(small) = &small {
            let detail = format!("in parts of fewer than {SMALL_PART} points, which are no surface");
            let message = format!("{}: {detail}", in_file(cloud, small));
            self.about(small, Finding::warning("small_parts", message, START));
        }
        let area = graph.areas.iter().sum();
        self.counted.extend([
            Diagnostic::count("parts", graph.part_count as u64, "Connected parts of the surface."),
            Diagnostic::count(
                "parts.largest",
                sizes.iter().max().map_or(0, |size| *size as u64),
                "Points of the largest part.",
            ),
            Diagnostic::new("area", area, "Area of the cells of all points, or length on a curve."),
        ]);
    }

    /// Adds a finding about points of the cloud, and a mark.
    fn about(&mut self, list: &PointList, finding: Finding) {
        if let std::borrow::Cow::Borrowed(code) = finding.code {
            self.marks.push(Mark { code, points: list.all.clone() });
        }
        self.findings.push(finding.about(&list.first).with_count(list.count as u64));
    }
}

/// The points by their numbers in the file.
fn in_file<const D: usize>(cloud: &PreparedCloud<D>, list: &PointList) -> PointList {
    let numbers = |indices: &[usize]| indices.iter().map(|i| cloud.kept[*i]).collect();
    PointList { first: numbers(&list.first), count: list.count, all: numbers(&list.all) }
}
