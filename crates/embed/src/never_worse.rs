//! The last look at a result, from its own rows: is it certified, and is nothing in the run better?
//!
//! **Input** the embedding as it will be written, the rows of all methods, the method asked for. **Output** nothing, or
//! an error that is a bug of ours.
//! **Guarantees** an embedding that leaves the stage is certified; if an optimiser was asked for, its energy is not
//! above that of any certified layout of the run that was scored against the same targets, unless manual edits were
//! made in it or it gave way to widths; and its own row says the
//! same of it as the embedding does. Checked in every run, from what is written and not from how it was chosen.
//! **Cost** one look at each row.

use espalier_model::{Embedding, MethodRow, WidthMode};

use crate::choices::Method;
use crate::error::Error;

/// Energies are equal if they differ by no more than this, or than this share of the larger: 1e-12 is the energy
/// of ratios of a millionth, which rounding can leave.
const EQUAL: f64 = 1e-12;

/// Whether two energies are equal up to rounding.
pub(crate) fn is_equal(a: f64, b: f64) -> bool {
    (a - b).abs() <= EQUAL * a.max(b).max(1.0)
}

/// Checks a result whose row is `chosen`.
pub(crate) fn check(embedding: &Embedding, chosen: usize, asked: Method) -> Result<(), Error> {
    let energy = embedding.energy.total();
    let is_own = |row: &MethodRow| row.method == embedding.method && row.energy == embedding.energy;
    let worse = |row: &MethodRow| Error::Worse {
        method: embedding.method.clone(),
        energy,
        other: row.method.clone(),
        least: row.energy.total(),
    };
    if let Some(row) = embedding.methods.get(chosen).filter(|row| !is_own(row)) {
        return Err(worse(row));
    }
    if !embedding.certificate.holds() {
        let (first, second) = embedding.certificate.pairs.first().copied().unwrap_or_default();
        return Err(Error::Uncertified { crossings: embedding.certificate.crossings, first, second });
    }
    let is_better = |row: &&MethodRow| {
        let least = row.energy.total();
        row.crossings == 0
            && row.targets == embedding.targets.kind
            && !(energy <= least || is_equal(energy, least))
    };
    // What was pinned by hand or gave way to widths may cost more than what was found.
    let is_report = embedding.widths.mode == WidthMode::Report;
    let is_free = asked.is_optimiser() && embedding.edits.is_empty() && is_report;
    match embedding.methods.iter().find(is_better) {
        Some(row) if is_free => Err(worse(row)),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use espalier_model::TargetKind;
    use espalier_model::diagnose::{Class, Diagnose};
    use glam::DVec3;

    use super::*;
    use crate::common::{random_tree, views_along};
    use crate::params::{Params, PsoParams};

    /// An honest result, and the place of its row.
    fn result() -> (Embedding, usize) {
        let tree = random_tree(0, 60, 1.0, false, 3);
        let pso = PsoParams { particles: 24, iterations: 4, ..PsoParams::default() };
        let params = Params { pso, ..Params::default() };
        let embedded =
            crate::embed(&tree, &views_along(&tree, DVec3::Z), &params, 7, &|_| {}).expect("a layout");
        (embedded.embedding, embedded.comparison.chosen)
    }

    #[test]
    fn a_better_layout_in_the_run_is_an_error_of_ours() {
        let (honest, chosen) = result();
        assert_eq!(check(&honest, chosen, Method::Solver), Ok(()));
        let other = (0..honest.methods.len())
            .find(|&idx| idx != chosen && honest.methods[idx].crossings == 0)
            .expect("another layout");

        let mut worse = honest.clone();
        worse.methods[other].energy = espalier_model::Energy::default();
        let error = check(&worse, chosen, Method::Solver).expect_err("something is better");
        assert_eq!((error.class(), error.code()), (Class::Internal, "E-EMBED-WORSE"));
        assert!(matches!(&error, Error::Worse { other: name, .. } if *name == honest.methods[other].method));
        // A constructive method is used as it was asked for.
        assert_eq!(check(&worse, chosen, Method::Radial), Ok(()));
        // Layouts that cross, or that aim at something else, do not compare.
        worse.methods[other].crossings = 1;
        assert_eq!(check(&worse, chosen, Method::Solver), Ok(()));
        worse.methods[other].crossings = 0;
        worse.methods[other].targets = TargetKind::Projected;
        assert_eq!(check(&worse, chosen, Method::Solver), Ok(()));
        // What cannot be ordered is not better, but nor is it equal.
        worse.methods[other].targets = honest.targets.kind;
        worse.methods[other].energy.angle = f64::NAN;
        assert!(check(&worse, chosen, Method::Solver).is_err());
    }

    #[test]
    fn the_row_and_the_certificate_are_those_of_the_result() {
        let (honest, chosen) = result();
        let mut other_row = honest.clone();
        other_row.methods[chosen].energy.angle += 1.0;
        assert!(matches!(check(&other_row, chosen, Method::Solver), Err(Error::Worse { .. })));
        let mut crossing = honest;
        crossing.certificate.crossings = 2;
        crossing.certificate.pairs = vec![(3, 5), (4, 9)];
        let expected = Error::Uncertified { crossings: 2, first: 3, second: 5 };
        assert_eq!(check(&crossing, chosen, Method::Solver), Err(expected));
    }
}
