//! A layout as it is written, with all that is said about it.
//!
//! **Input** a problem, a layout in its pose. **Output** `Judged`: certificate, energy, losses and widths.
//! **Guarantees** every layout is scored from its coordinates as written, in the handedness of the targets (see `pose`).

use espalier_model::{
    Certificate, ComparedLayout, Losses, MethodRow, TargetKind, Termination, TracePoint, Widths,
};
use glam::DVec2;

use crate::choices::Method;
use crate::distances::SpaceDistances;
use crate::energy::{self, Scored};
use crate::layout::{Aim, Layout};
use crate::pose::Posed;
use crate::problem::Problem;
use crate::{certify, losses, widths};

/// A layout as it is written, with all that is said about it.
pub(crate) struct Judged {
    pub(crate) method: Method,
    pub(crate) name: String,
    /// As the method left it: before pose and rounding.
    pub(crate) drawn: Vec<DVec2>,
    pub(crate) posed: Posed,
    pub(crate) certificate: Certificate,
    pub(crate) scored: Scored,
    pub(crate) losses: Losses,
    pub(crate) widths: Widths,
    pub(crate) evaluations: u64,
    pub(crate) trace: Vec<TracePoint>,
    pub(crate) termination: Termination,
    pub(crate) aim: Aim,
    pub(crate) targets: TargetKind,
}

/// Judges a layout of a method.
pub(crate) fn judge(
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

impl Judged {
    /// Whether no length and no angle is lost, whatever it weighs: the least of Eq. 4 for these targets.
    pub(crate) fn is_optimal(&self) -> bool {
        let Scored { length_ratio, angle_ratio, .. } = &self.scored;
        length_ratio.iter().chain(angle_ratio).all(|&ratio| ratio == 0.0)
    }

    /// Why the method ended: optimal only where nothing is lost as written.
    pub(crate) fn ended(&self) -> Termination {
        match self.termination {
            _ if self.is_optimal() => Termination::Optimal,
            Termination::Optimal => Termination::Converged,
            other => other,
        }
    }

    /// Its row and its coordinates in the comparison.
    pub(crate) fn compared(&self) -> ComparedLayout {
        let row = MethodRow {
            method: self.name.clone(),
            crossings: self.certificate.crossings,
            overlaps: self.widths.overlaps,
            energy: self.scored.energy,
            losses: self.losses,
            evaluations: self.evaluations,
            targets: self.targets,
        };
        ComparedLayout {
            row,
            quantum_mm: self.posed.quantum_mm,
            positions_mm: self.posed.positions.clone(),
            trace: self.trace.clone(),
        }
    }
}
