//! Running the methods, judging them alike, and taking the best.
//!
//! **Input** the problem, params, seed. **Output** `Embedded`.
//! **Steps** 1. Run the methods. 2. Each layout gets its pose and is rounded. 3. Exact certificate, energy, losses.
//! 4. The winner: for an optimiser the certified layout of least energy, whoever made it; of equal ones, its own. For a
//! constructive method that method, or if it has crossings the certified layout of least energy. 5. Manual edits are
//! made in it (see `replay`); the result is then the edited layout, one more row of the comparison.
//! **Guarantees** the result is certified, and under an optimiser never worse than any certified layout that ran. Every
//! layout is scored from its coordinates as written, in the handedness of the targets (see `pose`).
//! **Cost** dominated by the swarm.

use espalier_model::{
    Certificate, ComparedLayout, Comparison, EditRecord, Edits, Embedding, Losses, MethodRow, Report,
    TargetKind, Termination, TracePoint, ViewHierarchy,
};
use glam::DVec2;
use rayon::prelude::*;

use crate::choices::Method;
use crate::distances::SpaceDistances;
use crate::energy::{self, Scored};
use crate::error::Error;
use crate::layout::{Layout, cone, marino, projection, pso, radial};
use crate::params::Params;
use crate::pose::{self, Posed};
use crate::problem::Problem;
use crate::replay;
use crate::{Embedded, Event, certify, losses, overlap, place, solver};

/// Every layout that the params ask for, by method, each method once, in a fixed order.
pub(crate) fn run_methods(
    problem: &Problem,
    views: &ViewHierarchy,
    params: &Params,
    seed: u64,
    events: &(dyn Fn(Event) + Sync),
) -> Result<Vec<(Method, Layout)>, Error> {
    let wants = |method: Method| params.method == method || params.methods.contains(&method);
    let placed =
        |name: &str, headings: &[f64]| Ok(Layout::constructed(name, place::from_headings(problem, headings)));
    let mut layouts = Vec::new();
    if wants(Method::Projection) {
        let project = || Ok(Layout::constructed("projection", projection::positions(problem, &views.global)));
        layouts.push(announced(events, Method::Projection, project)?);
    }
    // Radial and cone cost next to nothing, and one of them is the way out when the method asked for crosses.
    let (mut radial, mut cone) = (Vec::new(), Vec::new());
    layouts.push(announced(events, Method::Radial, || {
        radial = radial::headings(problem);
        placed("radial", &radial)
    })?);
    layouts.push(announced(events, Method::Cone, || {
        cone = cone::headings(problem);
        placed("cone", &cone)
    })?);
    if wants(Method::Marino) {
        let marino = || Ok(marino::layout(problem, views, &params.marino));
        layouts.push(announced(events, Method::Marino, marino)?);
    }
    if wants(Method::Pso) {
        let progress = |progress| events(Event::Searching(progress));
        let swarm = || pso::layout(problem, (&radial, &cone), (&params.pso, seed), &progress);
        layouts.push(announced(events, Method::Pso, swarm)?);
    }
    if wants(Method::Solver) {
        layouts.push(announced(events, Method::Solver, || Ok(solver::layout(problem, &cone, params)))?);
    }
    Ok(layouts)
}

/// Runs a method between the events of its beginning and its end.
fn announced(
    events: &(dyn Fn(Event) + Sync),
    method: Method,
    work: impl FnOnce() -> Result<Layout, Error>,
) -> Result<(Method, Layout), Error> {
    events(Event::Started { method });
    let layout = work()?;
    events(Event::Finished { name: layout.name.clone() });
    Ok((method, layout))
}

/// Energies are equal if they differ by no more than this, or than this share of the larger: 1e-12 is the energy
/// of ratios of a millionth, which rounding can leave.
const EQUAL: f64 = 1e-12;

/// A layout as it is written, with all that is said about it.
struct Judged {
    method: Method,
    name: String,
    /// As the method left it: before pose and rounding.
    drawn: Vec<DVec2>,
    posed: Posed,
    certificate: Certificate,
    scored: Scored,
    losses: Losses,
    overlaps: overlap::Overlaps,
    evaluations: u64,
    trace: Vec<TracePoint>,
    termination: Termination,
}

fn judge(
    (problem, space): (&Problem, &SpaceDistances),
    method: Method,
    layout: Layout,
    posed: Posed,
) -> Judged {
    let certificate = certify::certify(problem.tree, &posed.positions);
    let unreflected = posed.unreflected();
    let scored = energy::score(problem, &unreflected, posed.quantum_mm, certificate.crossings);
    let mut losses = losses::losses(problem, &unreflected);
    (losses.stress, losses.spearman) = space.compare(&posed.positions);
    let overlaps = overlap::count(problem, &posed.positions);
    let Layout { name, evaluations, trace, termination, positions: drawn } = layout;
    Judged {
        method,
        name,
        drawn,
        posed,
        certificate,
        scored,
        losses,
        overlaps,
        evaluations,
        trace,
        termination,
    }
}

/// A layout with manual edits made, in the pose that it had: what is not edited stays where it is.
fn edited(
    (problem, space): (&Problem, &SpaceDistances),
    winner: &Judged,
    edits: &Edits,
    params: &Params,
) -> Result<(Judged, Vec<EditRecord>), Error> {
    let base = replay::Base {
        positions: &winner.drawn,
        is_reflected: winner.posed.pose.is_reflected,
        quantum_mm: winner.posed.quantum_mm,
        energy: winner.scored.energy.total(),
    };
    let mut replayed = replay::replay(problem, &base, edits.list(), params)?;
    let posed = pose::posed_like(&replayed.positions, winner.posed.pose);
    let name = format!("{}, edited", winner.name);
    let layout = Layout {
        name,
        positions: replayed.positions.clone(),
        evaluations: replayed.work,
        trace: Vec::new(),
        termination: replayed.termination,
    };
    let edited = judge((problem, space), winner.method, layout, posed);
    if !edited.certificate.holds() {
        return Err(replay::conflict(problem, edits.list(), &edited.certificate));
    }
    replay::measure(problem, &mut replayed, &edited.posed, edited.scored.energy.total());
    Ok((edited, replayed.records))
}

/// Judges the layouts, takes the best, and makes the edits in it.
pub(crate) fn select(
    problem: &Problem,
    layouts: Vec<(Method, Layout)>,
    edits: &Edits,
    (params, seed): (&Params, u64),
) -> Result<Embedded, Error> {
    let space = SpaceDistances::new(problem.tree);
    let mut judged: Vec<Judged> = layouts
        .into_par_iter()
        .map(|(method, layout)| {
            let posed = pose::pose(problem, &layout.positions, params.pose);
            judge((problem, &space), method, layout, posed)
        })
        .collect();
    let mut chosen = winner(&judged, params.method)?;
    let mut report = report(problem, &judged, &judged[chosen], params.method);
    let mut records = Vec::new();
    if !edits.list().is_empty() {
        let made = edited((problem, &space), &judged[chosen], edits, params)?;
        report.extend(edits_report(&made));
        records = made.1;
        chosen = judged.len();
        judged.push(made.0);
    }
    let layouts: Vec<ComparedLayout> =
        judged.iter().map(|judged| compared(judged, problem.targets.kind)).collect();
    let methods = layouts.iter().map(|layout| layout.row.clone()).collect();
    let asked = judged.iter().find(|judged| judged.method == params.method);
    let trace = asked.map(|judged| judged.trace.clone()).unwrap_or_default();
    let comparison =
        Comparison { tree: problem.tree.digest(), targets: problem.targets.digest(), seed, chosen, layouts };

    let Judged { name, posed, certificate, scored, losses, termination, .. } = judged.swap_remove(chosen);
    let is_lossless = scored.energy.length + scored.energy.angle == 0.0;
    let termination = if is_lossless { Termination::Optimal } else { termination };
    let embedding = Embedding {
        tree: problem.tree.digest(),
        method: name,
        seed,
        positions_mm: posed.positions,
        quantum_mm: posed.quantum_mm,
        targets: problem.targets.clone(),
        length_ratio: scored.length_ratio,
        angle_ratio: scored.angle_ratio,
        energy: scored.energy,
        losses,
        certificate,
        pose: posed.pose,
        termination,
        trace,
        methods,
        edits: records,
    };
    Ok(Embedded { embedding, comparison, report })
}

fn edits_report((edited, records): &(Judged, Vec<EditRecord>)) -> Report {
    let mut report = Report::default();
    report.count_usize("edits", records.len());
    report.count_usize("edits_crossings_removed", records.iter().map(|r| r.crossings_removed).sum());
    report.count("energy_edited", edited.scored.energy.total());
    report
}

/// The index of the layout to use.
fn winner(judged: &[Judged], asked: Method) -> Result<usize, Error> {
    let energy = |idx: usize| judged[idx].scored.energy.total();
    let certified = (0..judged.len()).filter(|&idx| judged[idx].certificate.holds());
    let best = certified.clone().min_by(|&a, &b| energy(a).total_cmp(&energy(b)));
    let as_asked = certified.clone().find(|&idx| judged[idx].method == asked);
    let is_equal = |a: f64, b: f64| (a - b).abs() <= EQUAL * a.max(b).max(1.0);
    if let (Some(own), Some(best)) = (as_asked, best)
        && (!asked.is_optimiser() || is_equal(energy(own), energy(best)))
    {
        return Ok(own);
    }
    best.ok_or_else(|| {
        let fewest = judged.iter().min_by_key(|judged| judged.certificate.crossings);
        let certificate = fewest.map_or_else(Certificate::default, |judged| judged.certificate.clone());
        let (first, second) = certificate.pairs.first().copied().unwrap_or_default();
        Error::Uncertified { crossings: certificate.crossings, first, second }
    })
}

fn compared(judged: &Judged, targets: TargetKind) -> ComparedLayout {
    let row = MethodRow {
        method: judged.name.clone(),
        crossings: judged.certificate.crossings,
        overlaps: judged.overlaps.count,
        energy: judged.scored.energy,
        losses: judged.losses,
        evaluations: judged.evaluations,
        targets,
    };
    ComparedLayout { row, quantum_mm: judged.posed.quantum_mm, positions_mm: judged.posed.positions.clone() }
}

fn report(problem: &Problem, judged: &[Judged], winner: &Judged, asked: Method) -> Report {
    let mut report = Report::default();
    report.count_usize("nodes", problem.n_nodes());
    report.count_usize("branches", problem.branches.list().len());
    report.count_usize("crossings", winner.certificate.crossings);
    report.count_usize("overlaps", winner.overlaps.count);
    report.count("energy", winner.scored.energy.total());
    report.count("length_loss_mean", winner.losses.length_loss_mean);
    report.count("angle3d_error_mean_deg", winner.losses.angle3d_error_mean_deg);
    report.count("evaluations", judged.iter().map(|judged| judged.evaluations as f64).sum::<f64>());
    if !winner.overlaps.is_complete {
        let message = format!(
            "the mean radius is {} mm, the median edge {} mm: too many tubes overlap to count them all; check the \
             unit of the radii",
            problem.tree.mean_radius_mm(),
            problem.scale_mm
        );
        report.warn("W-EMBED-THICK-TUBES", message);
    }
    if winner.method != asked {
        let reason = match judged.iter().find(|judged| judged.method == asked) {
            Some(judged) if judged.certificate.holds() => {
                let (energy, least) = (judged.scored.energy.total(), winner.scored.energy.total());
                format!("has the energy {energy:.4}, which is higher by {:.1e}", energy - least)
            }
            Some(judged) => format!("has {} crossings", judged.certificate.crossings),
            None => "did not run".to_owned(),
        };
        let message = format!("the layout is by {}, because {} {reason}", winner.name, asked.name());
        report.warn("W-EMBED-OTHER-METHOD", message);
    }
    report
}
