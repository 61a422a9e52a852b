//! What stands in the chart.
#![allow(clippy::expect_used, reason = "a test says what it expects")]

use espalier_model::{Energy, Losses, Phase, TargetKind};

use super::*;

fn row(method: &str, energy: f64, crossings: usize) -> MethodRow {
    MethodRow {
        method: method.to_owned(),
        crossings,
        overlaps: 0,
        energy: Energy { length: energy, ..Energy::default() },
        losses: Losses::default(),
        evaluations: 9,
        targets: TargetKind::Intrinsic,
    }
}

fn point(phase: Phase, evaluations: u64, energy: f64) -> TracePoint {
    TracePoint { phase, iteration: 0, evaluations, energy, crossings: 0 }
}

fn svg_of(methods: &[(MethodRow, Vec<TracePoint>)]) -> String {
    let searched: Vec<Searched<'_>> =
        methods.iter().map(|(row, trace)| Searched { row, trace, is_chosen: false }).collect();
    convergence(&searched, &Params { width_px: 600, ..Params::default() }).expect("a figure").svg
}

#[test]
fn a_search_has_dots_and_words_and_a_construction_a_broken_line() {
    let trace = vec![
        point(Phase::Start, 0, 10.0),
        point(Phase::Descent, 1000, 1.0),
        point(Phase::Barrier, 1001, 0.99),
    ];
    let svg = svg_of(&[(row("solver", 0.99, 0), trace), (row("radial", 5.0, 3), Vec::new())]);
    assert!(svg.contains(">start<") && svg.contains(">descent<"), "{svg}");
    assert!(!svg.contains(">barrier<"), "it would stand on the word beside it");
    assert!(svg.contains(">radial 5, 3 crossings<") && svg.contains(">solver 0.99<"), "{svg}");
    assert!(svg.matches("<line").count() > 20, "dashes");
}

#[test]
fn nothing_odd_leaves_the_chart() {
    let odd = vec![
        point(Phase::Start, 0, f64::INFINITY),
        point(Phase::Swarm, u64::MAX, f64::NAN),
        point(Phase::Swarm, u64::MAX, 0.0),
    ];
    for methods in [
        vec![],
        vec![(row("solver", 0.0, 0), odd.clone())],
        vec![(row("solver", 1e300, 0), odd), (row("radial", 1e-300, 0), Vec::new())],
    ] {
        let svg = svg_of(&methods);
        assert!(!svg.contains("NaN") && !svg.contains("inf"), "{svg}");
    }
}

#[test]
fn numbers_that_can_be_read() {
    for (value, expected) in [(1.0, "1"), (200.0, "200"), (1e3, "1 k"), (5e6, "5 M"), (1e10, "10 G")] {
        assert_eq!(counted(value), expected);
    }
}
