//! The swarm on phantom trees with the views that the pipeline would find.
#![allow(clippy::expect_used, reason = "a test that cannot go on says why")]

use espalier_embed::{Embedded, Params, PsoParams, embed};
use espalier_model::Tree;
use espalier_phantom::{Kind, grow_tree};
use espalier_views::find_views;

fn laid_flat(tree: &Tree, params: &Params) -> Embedded {
    let views = find_views(tree, &espalier_views::Params::default(), 0).expect("views").hierarchy;
    embed(tree, &views, params, 0, &|_| {}).expect("a certified layout")
}

/// The lower energy of the radial layout and the cone.
fn constructed_energy(embedded: &Embedded) -> f64 {
    let rows = &embedded.embedding.methods;
    let energies = rows.iter().filter(|row| row.method == "radial" || row.method == "cone");
    energies.map(|row| row.energy.total()).fold(f64::INFINITY, f64::min)
}

#[test]
fn the_default_swarm_is_far_better_than_its_starts() {
    for seed in [2, 3, 5] {
        let tree = grow_tree(Kind::Neuron, &espalier_phantom::Params::default(), seed).expect("a phantom");
        let embedded = laid_flat(&tree, &Params::default());
        let energy = embedded.embedding.energy.total();
        let constructed = constructed_energy(&embedded);
        assert!(energy < 0.1 * constructed, "seed {seed}: {energy} against {constructed}");
        assert!(embedded.embedding.losses.angle3d_error_mean_deg < 2.0, "seed {seed}");
    }
}

#[test]
fn the_papers_swarm_ends_without_crossings_and_never_worse() {
    let tree = grow_tree(Kind::Neuron, &espalier_phantom::Params::default(), 2).expect("a phantom");
    let params =
        Params { pso: PsoParams { particles: 400, iterations: 12, ..PsoParams::paper() }, ..Params::paper() };
    let embedded = laid_flat(&tree, &params);
    assert!(embedded.embedding.certificate.holds());
    assert!(embedded.embedding.energy.total() <= constructed_energy(&embedded));
    assert_eq!(embedded.embedding.trace.len(), 13);
    // 400 × 13 evaluations and the first look at the targets.
    assert_eq!(embedded.embedding.trace[12].evaluations, 5201);
}
