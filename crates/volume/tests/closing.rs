//! Closing gaps by a ball: known gaps, every voxel by brute force, what a closing must keep.
#![allow(clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

use espalier_geom::random::{Purpose, Stream};
use espalier_model::{Diagnose, Grid, LedgerKind, Mask};
use espalier_volume::{Components, Params, Segmented, clean};
use glam::DVec3;

fn grid(shape: [usize; 3], spacing_mm: DVec3) -> Grid {
    Grid::axis_aligned(shape, spacing_mm, DVec3::ZERO).expect("legal")
}

/// Nothing but the closing.
fn closing(radius_mm: f64) -> Params {
    Params {
        closing_mm: radius_mm,
        components: Components::All,
        fill_cavities: false,
        close_tunnels: false,
        thick_slices: 0.0,
        ..Params::default()
    }
}

fn close(mask: &Mask, radius_mm: f64) -> Segmented {
    clean(mask.clone(), &closing(radius_mm)).unwrap_or_else(|error| panic!("{error}"))
}

/// The closing by its definition, voxel by voxel: a voxel stays background where a ball that holds it touches no voxel
/// of the mask.
fn plain(mask: &Mask, radius_mm: f64) -> Mask {
    let spacing = mask.grid().spacing_mm();
    let reach = (DVec3::splat(radius_mm) / spacing).ceil().to_array().map(|v| v as i64);
    let span = |axis: usize| -reach[axis]..=reach[axis];
    let all = span(2).flat_map(|z| span(1).flat_map(move |y| span(0).map(move |x| [x, y, z])));
    let ball: Vec<[i64; 3]> = all
        .filter(|offset| {
            let offset_mm = DVec3::from_array(offset.map(|v| v as f64)) * spacing;
            offset_mm.length() <= radius_mm * (1.0 + 1e-9)
        })
        .collect();
    let add = |a: [i64; 3], b: [i64; 3]| [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
    let touches = |centre: [i64; 3]| ball.iter().any(|&offset| mask.contains(add(centre, offset)));
    Mask::from_fn(mask.grid().clone(), |voxel| {
        let voxel = voxel.map(|v| v as i64);
        ball.iter().all(|&offset| touches(add(voxel, offset)))
    })
}

fn random_mask(case: u64) -> (Mask, f64) {
    let mut stream = Stream::new(case, Purpose::Test, 0, 0);
    let nx = if case.is_multiple_of(3) { 58 + stream.below(12) } else { 1 + stream.below(9) };
    let shape = [nx, 1 + stream.below(8), 1 + stream.below(7)].map(|v| v as usize);
    let spacing_mm = DVec3::new(stream.uniform(0.5, 2.0), stream.uniform(0.5, 2.0), stream.uniform(0.5, 4.0));
    let spacing_mm = if case.is_multiple_of(2) { DVec3::ONE } else { spacing_mm };
    let density = stream.uniform(0.02, 0.4);
    let n_voxels = shape.iter().product();
    let mut voxels: Vec<bool> = (0..n_voxels).map(|_| stream.unit() < density).collect();
    // A mask without any voxel is refused.
    voxels[0] = true;
    let radius_mm = [1.0, 2.0, stream.uniform(0.3, 3.5)][stream.below(3) as usize];
    (Mask::from_voxels(grid(shape, spacing_mm), &voxels), radius_mm)
}

#[test]
fn a_gap_closes_from_its_width_on() {
    // Two plates, four voxels of 0.5 mm apart: a ball between them has a radius of 1 mm or less than that.
    let plates = Mask::from_fn(grid([20, 15, 15], DVec3::splat(0.5)), |[x, y, z]| {
        (x == 5 || x == 10) && (2..13).contains(&y) && (2..13).contains(&z)
    });
    assert_eq!(close(&plates, 0.99).mask, plates);
    let closed = close(&plates, 3.0);
    let is_filled = |x: i64| closed.mask.contains([x, 7, 7]);
    assert!((5..=10).all(is_filled) && !is_filled(4) && !is_filled(11));
    assert_eq!(closed.report.get("components"), Some(1.0));
    assert_eq!(closed.report.get("closing_patches"), Some(1.0));
    let n_filled = closed.mask.n_foreground() - plates.n_foreground();
    assert_eq!(closed.report.get("closing_filled_voxels"), Some(n_filled as f64));
    let entry = &closed.ledger.0[0];
    assert_eq!((entry.kind, closed.ledger.0.len()), (LedgerKind::GapClosed, 1));
    assert!((entry.position_mm - DVec3::new(3.75, 3.5, 3.5)).length() < 1e-9, "{}", entry.position_mm);
}

/// With thick slices a gap of two voxels is wide along z and narrow along x.
#[test]
fn spacing_counts() {
    let shape = [9, 9, 9];
    let spacing_mm = DVec3::new(0.5, 0.5, 4.0);
    let along = |axis: usize| {
        Mask::from_fn(grid(shape, spacing_mm), move |voxel| voxel[axis] == 2 || voxel[axis] == 5)
    };
    let n_parts = |mask: &Mask| close(mask, 2.0).report.get("components");
    assert_eq!((n_parts(&along(0)), n_parts(&along(2))), (Some(1.0), Some(2.0)));
}

#[test]
fn equals_the_definition_and_keeps_what_a_closing_keeps() {
    let mut n_filled = 0;
    for case in 0..400 {
        let (mask, radius_mm) = random_mask(case);
        let closed = close(&mask, radius_mm).mask;
        assert_eq!(closed, plain(&mask, radius_mm), "case {case}, {radius_mm} mm");
        let words = mask.bits().words().iter().zip(closed.bits().words());
        assert!(words.clone().all(|(before, after)| before & !after == 0), "case {case} lost a voxel");
        assert_eq!(close(&closed, radius_mm).mask, closed, "case {case}: twice is not once");
        n_filled += closed.n_foreground() - mask.n_foreground();
    }
    assert!(n_filled > 2000, "the masks have gaps: {n_filled}");
}

#[test]
fn what_is_too_much_is_refused() {
    let (mask, _) = random_mask(0);
    for (radius_mm, code) in [(65.0, "E-VOLUME-CLOSING"), (-1.0, "E-PARAM"), (f64::NAN, "E-PARAM")] {
        let error = clean(mask.clone(), &closing(radius_mm)).expect_err("refused");
        assert_eq!((error.code(), error.class().exit_code()), (code, 2), "{error}");
    }
    // One long row, and a ball that would make a thousand of it: 60 GB.
    let mut row = Mask::empty(grid([30_000_000, 1, 1], DVec3::ONE));
    row.bits_mut().set([0, 0, 0]);
    row.bits_mut().set([29_999_999, 0, 0]);
    let error = clean(row, &closing(64.0)).expect_err("refused");
    assert_eq!((error.code(), error.class().exit_code()), ("E-VOLUME-TOO-LARGE", 5), "{error}");
}
