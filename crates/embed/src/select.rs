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
    TargetKind, Termination, TracePoint, ViewHierarchy, WidthMode, Widths,
};
use glam::DVec2;
use rayon::prelude::*;

use crate::choices::{Method, SwarmUse};
use crate::distances::SpaceDistances;
use crate::energy::{self, Scored};
use crate::error::Error;
use crate::layout::{Aim, Layout, cone, marino, projection, pso, radial};
use crate::params::Params;
use crate::pose::{self, Posed};
use crate::problem::Problem;
use crate::replay;
use crate::widths::Changed;
use crate::{Embedded, Event, certify, losses, never_worse, place, solver, widths};

/// The problems of a run.
#[derive(Clone, Copy)]
pub(crate) struct Problems<'a> {
    /// With the targets that are frozen for the run: every method aims at them.
    pub(crate) frozen: &'a Problem<'a>,
    /// With the targets of the local planes as they are, where sides were searched.
    pub(crate) unflipped: Option<&'a Problem<'a>>,
}

impl<'a> Problems<'a> {
    /// What a layout is scored against.
    fn of(&self, aim: Aim) -> &'a Problem<'a> {
        match (aim, self.unflipped) {
            (Aim::Unflipped, Some(unflipped)) => unflipped,
            _ => self.frozen,
        }
    }
}

/// Every layout that the params ask for, by method, each method once, in a fixed order.
pub(crate) fn run_methods(
    problems: Problems,
    views: &ViewHierarchy,
    params: &Params,
    seed: u64,
    events: &(dyn Fn(Event) + Sync),
) -> Result<Vec<(Method, Layout)>, Error> {
    let problem = problems.frozen;
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
    if wants(Method::Pso) && !is_too_large_for_swarm(problem, params) {
        let progress = |progress| events(Event::Searching(progress));
        let swarm = || pso::layout(problem, (&radial, &cone), (&params.pso, seed), &progress);
        layouts.push(announced(events, Method::Pso, swarm)?);
        // The same swarm with the sides as the paper has them: what the searched sides are worth to it.
        if let Some(unflipped) = problems.unflipped.filter(|unflipped| pso::targets_cross(unflipped)) {
            let starts = (radial::headings(unflipped), cone::headings(unflipped));
            let swarm = || {
                let layout = pso::layout(unflipped, (&starts.0, &starts.1), (&params.pso, seed), &progress)?;
                Ok(Layout { aim: Aim::Unflipped, ..layout })
            };
            layouts.push(announced(events, Method::Pso, swarm)?);
        }
    }
    if wants(Method::Solver) {
        layouts.push(announced(events, Method::Solver, || Ok(solver::layout(problem, &cone, params)))?);
    }
    if wants(Method::Solver) && params.swarm == SwarmUse::Polish {
        layouts.extend(polished(problem, &layouts, (params, seed), events)?);
    }
    Ok(layouts)
}

/// The solver's layout after a swarm; `None` where a swarm has nothing to gain.
fn polished(
    problem: &Problem,
    layouts: &[(Method, Layout)],
    (params, seed): (&Params, u64),
    events: &(dyn Fn(Event) + Sync),
) -> Result<Option<(Method, Layout)>, Error> {
    // The solver's own comes first: it ran last.
    let found: Vec<&Layout> =
        layouts.iter().rev().map(|(_, layout)| layout).filter(|layout| layout.aim == Aim::Frozen).collect();
    let progress = |progress| events(Event::Searching(progress));
    events(Event::Started { method: Method::Solver });
    let layout = pso::polish(problem, &found, (&params.pso, seed), &progress)?;
    let name = layout.as_ref().map_or("solver", |layout| &layout.name).to_owned();
    events(Event::Finished { name });
    Ok(layout.map(|layout| (Method::Solver, layout)))
}

/// Whether a swarm that is only there to compare is left out.
fn is_too_large_for_swarm(problem: &Problem, params: &Params) -> bool {
    params.method != Method::Pso && problem.n_nodes() > params.pso.max_nodes as usize
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
    widths: Widths,
    evaluations: u64,
    trace: Vec<TracePoint>,
    termination: Termination,
    aim: Aim,
    targets: TargetKind,
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
    let widths = widths::measure(problem, &posed.positions);
    let Layout { name, evaluations, trace, termination, positions: drawn, aim } = layout;
    let targets = problem.targets.kind;
    Judged {
        method,
        name,
        drawn,
        posed,
        certificate,
        scored,
        losses,
        widths,
        evaluations,
        trace,
        termination,
        aim,
        targets,
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
        aim: Aim::Frozen,
    };
    let mut edited = judge((problem, space), winner.method, layout, posed);
    (edited.widths.mode, edited.widths.length_scale) = (winner.widths.mode, winner.widths.length_scale);
    if !edited.certificate.holds() {
        return Err(replay::conflict(problem, edits.list(), &edited.certificate));
    }
    replay::measure(problem, &mut replayed, &edited.posed, edited.scored.energy.total());
    Ok((edited, replayed.records))
}

/// Judges the layouts, takes the best, and makes the edits in it.
pub(crate) fn select(
    problems: Problems,
    layouts: Vec<(Method, Layout)>,
    edits: &Edits,
    (params, seed): (&Params, u64),
) -> Result<Embedded, Error> {
    let problem = problems.frozen;
    let space = SpaceDistances::new(problem.tree);
    let mut judged: Vec<Judged> = layouts
        .into_par_iter()
        .map(|(method, layout)| {
            let problem = problems.of(layout.aim);
            let posed = pose::pose(problem, &layout.positions, params.pose);
            judge((problem, &space), method, layout, posed)
        })
        .collect();
    let chosen = winner(&judged, params.method)?;
    let mut chosen = at_widths((problem, &space), &mut judged, chosen, params);
    let mut report = report(problem, &judged, &judged[chosen], params);
    let mut records = Vec::new();
    if !edits.list().is_empty() {
        let made = edited((problem, &space), &judged[chosen], edits, params)?;
        report.extend(edits_report(&made));
        records = made.1;
        chosen = judged.len();
        judged.push(made.0);
    }
    let layouts: Vec<ComparedLayout> = judged.iter().map(compared).collect();
    let methods = layouts.iter().map(|layout| layout.row.clone()).collect();
    let asked = judged.iter().find(|judged| judged.method == params.method);
    let trace = asked.map(|judged| judged.trace.clone()).unwrap_or_default();
    let comparison =
        Comparison { tree: problem.tree.digest(), targets: problem.targets.digest(), seed, chosen, layouts };

    let Judged { name, posed, certificate, scored, losses, widths, termination, .. } =
        judged.swap_remove(chosen);
    let termination = if is_optimal(&scored) { Termination::Optimal } else { termination };
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
        widths,
        pose: posed.pose,
        termination,
        trace,
        methods,
        edits: records,
    };
    never_worse::check(&embedding, comparison.chosen, params.method)?;
    Ok(Embedded { embedding, comparison, report })
}

fn edits_report((edited, records): &(Judged, Vec<EditRecord>)) -> Report {
    let mut report = Report::default();
    report.count_usize("edits", records.len());
    report.count_usize("edits_crossings_removed", records.iter().map(|r| r.crossings_removed).sum());
    report.count("energy_edited", edited.scored.energy.total());
    report
}

/// Whether no length and no angle is lost: nothing can be better for these targets.
fn is_optimal(scored: &Scored) -> bool {
    scored.energy.length + scored.energy.angle == 0.0
}

/// Adds what the params ask for where the tubes of the layout to use overlap; the index of the layout to use then.
fn at_widths(
    (problem, space): (&Problem, &SpaceDistances),
    judged: &mut Vec<Judged>,
    chosen: usize,
    params: &Params,
) -> usize {
    let mode = params.widths.mode;
    judged.iter_mut().for_each(|judged| judged.widths.mode = mode.into());
    let winner = &judged[chosen];
    let Some(Changed { positions, length_scale }) = widths::change(problem, &winner.drawn, params) else {
        return chosen;
    };
    let posed = pose::pose(problem, &positions, params.pose);
    let layout = Layout {
        name: format!("{}-{}", winner.name, mode.name()),
        positions,
        evaluations: 0,
        trace: Vec::new(),
        termination: Termination::Converged,
        aim: Aim::Frozen,
    };
    let mut changed = judge((problem, space), winner.method, layout, posed);
    if !changed.certificate.holds() || changed.widths.overlaps >= winner.widths.overlaps {
        return chosen;
    }
    (changed.widths.mode, changed.widths.length_scale) = (mode.into(), length_scale);
    judged.push(changed);
    judged.len() - 1
}

/// The index of the layout to use.
fn winner(judged: &[Judged], asked: Method) -> Result<usize, Error> {
    let energy = |idx: usize| judged[idx].scored.energy.total();
    let is_candidate = |judged: &Judged| judged.certificate.holds() && judged.aim == Aim::Frozen;
    let certified = (0..judged.len()).filter(|&idx| is_candidate(&judged[idx]));
    let best = certified.clone().min_by(|&a, &b| energy(a).total_cmp(&energy(b)));
    let as_asked = certified.clone().find(|&idx| judged[idx].method == asked);
    if let (Some(own), Some(best)) = (as_asked, best)
        && (!asked.is_optimiser() || never_worse::is_equal(energy(own), energy(best)))
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

fn compared(judged: &Judged) -> ComparedLayout {
    let row = MethodRow {
        method: judged.name.clone(),
        crossings: judged.certificate.crossings,
        overlaps: judged.widths.overlaps,
        energy: judged.scored.energy,
        losses: judged.losses,
        evaluations: judged.evaluations,
        targets: judged.targets,
    };
    ComparedLayout {
        row,
        quantum_mm: judged.posed.quantum_mm,
        positions_mm: judged.posed.positions.clone(),
        trace: judged.trace.clone(),
    }
}

fn report(problem: &Problem, judged: &[Judged], winner: &Judged, params: &Params) -> Report {
    let asked = params.method;
    let mut report = Report::default();
    report.count_usize("nodes", problem.n_nodes());
    report.count_usize("branches", problem.branches.list().len());
    report.count_usize("crossings", winner.certificate.crossings);
    report.count_usize("overlaps", winner.widths.overlaps);
    report.count("radius_scale_without_overlaps", winner.widths.radius_scale);
    report.count("length_scale", winner.widths.length_scale);
    report.count("area_needed_mm2", winner.widths.area_needed_mm2);
    report.count("area_available_mm2", winner.widths.area_available_mm2);
    report.count("energy", winner.scored.energy.total());
    report.count("length_loss_mean", winner.losses.length_loss_mean);
    report.count("angle3d_error_mean_deg", winner.losses.angle3d_error_mean_deg);
    report.count("evaluations", judged.iter().map(|judged| judged.evaluations as f64).sum::<f64>());
    report.count("proven_optimal", f64::from(u8::from(is_optimal(&winner.scored))));
    if params.methods.contains(&Method::Pso) && is_too_large_for_swarm(problem, params) {
        report.count("pso_left_out_above_nodes", params.pso.max_nodes);
    }
    if !winner.widths.is_complete {
        let message = format!(
            "the mean radius is {} mm, the median edge {} mm: too many tubes overlap to count them all; check the \
             unit of the radii",
            problem.tree.mean_radius_mm(),
            problem.scale_mm
        );
        report.warn("W-EMBED-THICK-TUBES", message);
    }
    if winner.widths.are_impossible() {
        let Widths { area_needed_mm2, area_available_mm2, .. } = winner.widths;
        let message = format!(
            "the tubes need at least {area_needed_mm2:.0} mm², but with exact lengths there are only \
             {area_available_mm2:.0} mm²: no layout keeps both lengths and widths without overlaps"
        );
        report.warn("W-EMBED-NO-ROOM", message);
    }
    if winner.widths.mode != WidthMode::Report && winner.widths.overlaps > 0 {
        let Widths { overlaps, radius_scale, .. } = winner.widths;
        let message = format!("{overlaps} overlaps are left; none at {radius_scale:.3} of the radii");
        report.warn("W-EMBED-OVERLAPS", message);
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

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use espalier_model::Tree;
    use glam::DVec3;

    use super::*;
    use crate::common::{tree_of, views_along};
    use crate::params::PsoParams;
    use crate::targets;

    /// Two arms that cross in the view but not in space.
    fn crossing_tree() -> Tree {
        tree_of(&[
            (0.0, 0.0, 0.0, None),
            (1.0, 0.0, 0.0, Some(0)),
            (3.0, 2.0, 1.0, Some(1)),
            (3.0, -2.0, 1.0, Some(2)),
            (2.0, -1.0, -1.0, Some(1)),
            (4.0, 1.0, -1.0, Some(4)),
        ])
    }

    /// A run whose frozen targets have the second arm bend away from the first, where `is_mirrored`.
    fn run(tree: &Tree, params: &Params, is_mirrored: bool) -> Embedded {
        let (views, branches) = (views_along(tree, DVec3::Z), tree.branches());
        let as_seen = targets::targets(tree, &branches, &views, params.targets).expect("targets");
        let mut mirrored = as_seen.clone();
        for node in [3, 5].into_iter().filter(|_| is_mirrored) {
            mirrored.angle_rad[node] = TAU - mirrored.angle_rad[node];
        }
        mirrored.kind = TargetKind::IntrinsicMirrored;
        let unflipped = Problem::new(tree, branches.clone(), as_seen, params);
        let frozen = Problem::new(tree, branches, mirrored, params);
        let problems = if is_mirrored {
            Problems { frozen: &frozen, unflipped: Some(&unflipped) }
        } else {
            Problems { frozen: &unflipped, unflipped: None }
        };
        let layouts = run_methods(problems, &views, params, 0, &|_| {}).expect("layouts");
        select(problems, layouts, &Edits::none(tree), (params, 0)).expect("a certified layout")
    }

    fn small() -> Params {
        let pso = PsoParams { particles: 32, iterations: 10, ..PsoParams::default() };
        Params { method: Method::Pso, pso, ..Params::default() }
    }

    #[test]
    fn a_second_swarm_shows_what_searched_sides_are_worth() {
        let tree = crossing_tree();
        let embedded = run(&tree, &small(), true);
        let rows = &embedded.embedding.methods;
        let swarms: Vec<&MethodRow> = rows.iter().filter(|row| row.method.starts_with("pso")).collect();
        assert_eq!(swarms.len(), 2);
        assert_eq!(swarms[0].targets, TargetKind::IntrinsicMirrored);
        assert_eq!(swarms[1].targets, TargetKind::Intrinsic);
        assert_eq!(swarms[0].energy.angle, 0.0);
        assert!(swarms[1].energy.length + swarms[1].energy.angle > 0.0, "those targets cross");
        assert_eq!(embedded.embedding.targets.kind, TargetKind::IntrinsicMirrored);
        assert_eq!(embedded.embedding.termination, Termination::Optimal);
        assert_eq!(embedded.report.get("proven_optimal"), Some(1.0));

        let embedded = run(&tree, &small(), false);
        let rows = &embedded.embedding.methods;
        assert_eq!(rows.iter().filter(|row| row.method.starts_with("pso")).count(), 1);
        assert_eq!(embedded.report.get("proven_optimal"), Some(0.0));
    }

    #[test]
    fn what_aims_at_other_targets_is_never_the_result() {
        let tree = crossing_tree();
        // Nothing is lost against these targets, so the second swarm would be the best of all.
        let params = Params { w_length: 0.0, w_angle: 0.0, w_placement: 0.0, ..small() };
        let embedded = run(&tree, &params, true);
        let chosen = embedded.comparison.chosen;
        assert_eq!(embedded.embedding.methods[chosen].targets, TargetKind::IntrinsicMirrored);
    }

    #[test]
    fn a_polished_layout_is_a_row_and_never_worse_than_what_it_began_with() {
        let mut n_better = 0;
        for key in 0..12 {
            let tree = crate::common::random_tree(key as usize % 8, 60, 1.0, false, key);
            let pso = PsoParams { particles: 64, iterations: 12, ..PsoParams::default() };
            let solver = crate::params::SolverParams { mirrors: false, ..Default::default() };
            let params =
                Params { swarm: SwarmUse::Polish, methods: Vec::new(), pso, solver, ..Params::default() };
            let embedded = run(&tree, &params, false);
            let rows = &embedded.embedding.methods;
            let of = |name: &str| rows.iter().find(|row| row.method == name);
            let (solver, polished) = (of("solver").expect("a row"), of("solver + swarm 64x12"));
            // Where the targets do not cross there is nothing to polish.
            let Some(polished) = polished else {
                assert_eq!(solver.energy.angle, 0.0, "tree {key}");
                continue;
            };
            // Ratios go through positions and back.
            assert!(polished.energy.total() <= solver.energy.total() + 1e-9, "tree {key}");
            assert_eq!(polished.crossings, 0);
            n_better += usize::from(polished.energy.total() < solver.energy.total() - 1e-6);
            assert!(embedded.report.warnings.is_empty(), "tree {key}: {:?}", embedded.report.warnings);
        }
        assert!(n_better > 3, "{n_better}");
    }

    #[test]
    fn large_trees_have_smaller_swarms_or_none() {
        let pso = PsoParams::default();
        assert_eq!([1, 300, 301, 3000, 5000].map(|n| pso.particles_for(n)), [512, 512, 510, 51, 30]);
        assert_eq!(pso.particles_for(100_000), 16);
        assert_eq!(PsoParams { particles: 5, ..pso }.particles_for(100_000), 5);
        assert_eq!(PsoParams::paper().particles_for(4000), 40_960);

        let tree = crossing_tree();
        let tight = |method| {
            let pso = PsoParams { full_size_nodes: 3, max_nodes: 5, ..small().pso };
            run(&tree, &Params { method, pso, ..small() }, false)
        };
        let has_swarm =
            |embedded: &Embedded| embedded.embedding.methods.iter().any(|row| row.method.starts_with("pso"));
        let left_out = tight(Method::Cone);
        assert!(!has_swarm(&left_out));
        assert_eq!(left_out.report.get("pso_left_out_above_nodes"), Some(5.0));
        // Asked for by name, it runs.
        let asked = tight(Method::Pso);
        assert!(has_swarm(&asked));
        assert!(asked.embedding.methods.iter().any(|row| row.method == "pso 16x10 n"));
    }
}
