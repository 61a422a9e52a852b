//! Judging the methods' layouts alike, and taking the best.
//!
//! **Input** the problems, the layouts by method, manual edits, params, seed. **Output** `Embedded`.
//! **Steps** 1. Each layout gets its pose, is rounded and judged: exact certificate, energy, losses. 2. The winner: for
//! an optimiser the certified layout of least energy, whoever made it; of equal ones, its own. For a constructive method
//! that method, or if it has crossings the certified layout of least energy. 3. Where tubes overlap and the params ask
//! for it, the winner at the widths of its tubes. 4. Manual edits are made in it (see `replay`); the result is then the
//! edited layout, one more row of the comparison.
//! **Guarantees** the result is certified, and under an optimiser never worse than any certified layout that ran.

use espalier_model::{Certificate, ComparedLayout, Comparison, EditRecord, Edits, Embedding, Termination};
use glam::DVec2;
use rayon::prelude::*;

use crate::choices::Method;
use crate::distances::SpaceDistances;
use crate::error::Error;
use crate::judged::{Judged, judge};
use crate::layout::{Aim, Layout};
use crate::methods::Problems;
use crate::params::Params;
use crate::problem::Problem;
use crate::widths::Changed;
use crate::{Embedded, never_worse, pose, replay, summary, widths};

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
    let mut report = summary::of_layouts(problem, &judged, &judged[chosen], params);
    let mut records = Vec::new();
    if !edits.list().is_empty() {
        let made = edited((problem, &space), &judged[chosen], edits, params)?;
        report.extend(summary::of_edits(&made));
        records = made.1;
        chosen = judged.len();
        judged.push(made.0);
    }
    summary::warn_of_widths(problem, &judged[chosen].widths, &mut report);
    let layouts: Vec<ComparedLayout> = judged.iter().map(Judged::compared).collect();
    let methods = layouts.iter().map(|layout| layout.row.clone()).collect();
    let asked = judged.iter().find(|judged| judged.method == params.method);
    let trace = asked.map(|judged| judged.trace.clone()).unwrap_or_default();
    let comparison =
        Comparison { tree: problem.tree.digest(), targets: problem.targets.digest(), seed, chosen, layouts };

    let best = judged.swap_remove(chosen);
    let termination = best.ended();
    let Judged { name, posed, certificate, scored, losses, widths, .. } = best;
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

/// A layout with manual edits made, in the pose that it had: what is not edited stays where it is.
fn edited(
    (problem, space): (&Problem, &SpaceDistances),
    winner: &Judged,
    edits: &Edits,
    params: &Params,
) -> Result<(Judged, Vec<EditRecord>), Error> {
    let scale = winner.widths.length_scale;
    let unscaled: Vec<DVec2> = winner.drawn.iter().map(|&place| place / scale).collect();
    let base = replay::Base {
        positions: &unscaled,
        length_scale: scale,
        is_reflected: winner.posed.pose.is_reflected,
        quantum_mm: winner.posed.quantum_mm,
        energy: winner.scored.energy.total(),
    };
    let mut replayed = replay::replay(problem, &base, edits.list(), params)?;
    let length_scale = widths::stretch(problem, params, &replayed.positions);
    let positions: Vec<DVec2> = replayed.positions.iter().map(|&place| place * length_scale).collect();
    let posed = pose::posed_like(&positions, winner.posed.pose);
    let name = format!("{}, edited", winner.name);
    let layout = Layout {
        name,
        positions,
        evaluations: replayed.work,
        trace: Vec::new(),
        termination: replayed.termination,
        aim: Aim::Frozen,
    };
    let mut edited = judge((problem, space), winner.method, layout, posed);
    (edited.widths.mode, edited.widths.length_scale) = (winner.widths.mode, length_scale);
    if !edited.certificate.holds() {
        return Err(replay::conflict(problem, edits.list(), &edited.certificate));
    }
    replay::measure(problem, &mut replayed, &edited.posed, edited.scored.energy.total());
    Ok((edited, replayed.records))
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

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use espalier_model::{MethodRow, TargetKind, Tree};
    use glam::DVec3;

    use super::*;
    use crate::choices::SwarmUse;
    use crate::common::{tree_of, views_along};
    use crate::params::PsoParams;
    use crate::{methods, targets};

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
            Problems { frozen: &frozen, unflipped: Some(&unflipped), search_evaluations: 5 }
        } else {
            Problems { frozen: &unflipped, unflipped: None, search_evaluations: 0 }
        };
        let layouts = methods::run(problems, &views, params, 0, &|_| {}).expect("layouts");
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
