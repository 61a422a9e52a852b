//! Volume to mask: methods, parameters, components, cavities, ledger.
#![allow(clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

use espalier_model::{Diagnose, Grid, LedgerKind, Volume, Voxels};
use espalier_volume::{
    Components, Error, Kind, Method, Orientation, Params, Preset, Segmented, Spacing, inspect_kind, segment,
};
use glam::DVec3;
use ndarray::Array3;

/// A volume of whole numbers from rows of text; planes are separated by a blank line, `.` is 0.
fn volume(text: &str) -> Volume {
    let planes: Vec<Vec<&str>> = text.split("\n\n").map(|plane| plane.split_whitespace().collect()).collect();
    let (nz, ny, nx) = (planes.len(), planes[0].len(), planes[0][0].len());
    let digit = |c: char| c.to_digit(10).unwrap_or(0) as i16;
    let values: Vec<i16> = planes.iter().flatten().flat_map(|row| row.chars().map(digit)).collect();
    let array = Array3::from_shape_vec((nz, ny, nx), values).expect("rows of one length");
    let grid =
        Grid::axis_aligned([nx, ny, nz], DVec3::new(1.0, 2.0, 5.0), DVec3::splat(10.0)).expect("legal");
    Volume::new(grid, Voxels::I16(array), 1.0, 0.0)
}

fn picture(segmented: &Segmented) -> String {
    let [nx, ny, _] = segmented.mask.grid().shape();
    let row = |row: &[bool]| row.iter().map(|&v| if v { '#' } else { '.' }).collect::<String>();
    let plane = |plane: &[bool]| plane.chunks(nx).map(row).collect::<Vec<_>>().join(" ");
    segmented.mask.to_voxels().chunks(nx * ny).map(plane).collect::<Vec<_>>().join(" | ")
}

fn check(text: &str, params: &Params, expected: &str) -> Segmented {
    let params = Params { thick_slices: 0.0, ..params.clone() };
    let segmented = segment(&volume(text), &params).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(picture(&segmented), expected);
    segmented
}

fn code(text: &str, params: &Params) -> String {
    let error = segment(&volume(text), params).expect_err("refused");
    assert!(!error.hint().is_empty() || matches!(error, Error::Param(_)), "{error}");
    format!("{} {}", error.code(), error.class().exit_code())
}

#[test]
fn methods() {
    let all = Params { components: Components::All, ..Params::default() };
    check("..77 7...", &all, "..## #...");
    check("4466", &all, "..##");
    check("0123 0321", &Params { label: Some(2.0.into()), ..all }, "..#. ..#.");
    let band = Params { method: Method::Threshold, lower: Some(2.0), upper: Some(3.0), ..all.clone() };
    check("01234567", &band, "..##....");
    check("0120", &Params { method: Method::Mask, ..all.clone() }, ".##.");
    // Over faces only, ends of the band included, and never out of the row into the next.
    let grow = Params { method: Method::RegionGrow, lower: Some(3.0), seed_voxel: Some([0, 0, 0]), ..all };
    check("35.9 .49. ...9", &grow, "##.. .##. ....");
    check("5..5 ....", &grow, "#... ....");
    let by_mm = Params { seed_voxel: None, seed_mm: Some([13.4, 10.9, 10.0]), ..grow.clone() };
    check("5..5 ....", &by_mm, "...# ....");

    assert_eq!(code("0123", &Params::default()), "E-VOLUME-METHOD 2");
    assert_eq!(code("0000", &Params::default()), "E-VOLUME-EMPTY 3");
    assert_eq!(code("0000", &Params { method: Method::Mask, ..Params::default() }), "E-VOLUME-EMPTY 3");
    assert_eq!(code("0012", &Params { label: Some(5.0.into()), ..Params::default() }), "E-VOLUME-EMPTY 3");
    assert_eq!(code("0012", &Params { lower: Some(9.0), ..band }), "E-PARAM 2");
    assert_eq!(code("0012", &grow), "E-VOLUME-EMPTY 3");
    assert_eq!(code("0092", &grow), "E-VOLUME-SEED-BAND 2");
    for seed in [[-1, 0, 0], [4, 0, 0], [0, i64::MAX, 0], [0, 0, i64::MIN]] {
        assert_eq!(
            code("9092", &Params { seed_voxel: Some(seed), ..grow.clone() }),
            "E-VOLUME-SEED-OUTSIDE 2"
        );
    }
}

#[test]
fn the_seed_is_told_where_to_go() {
    let params = Params {
        method: Method::RegionGrow,
        lower: Some(5.0),
        seed_voxel: Some([1, 0, 0]),
        ..Params::default()
    };
    // (3, 0) is 2 mm away along x, (1, 1) 2 mm along y: of equal distances the first in storage order.
    let error = segment(&volume("0107 0800"), &params).expect_err("not in the band");
    assert_eq!(
        error.to_string(),
        "the seed voxel (1, 0, 0) has the value 1, outside 5 to inf; the nearest voxel inside is (3, 0, 0), 2.0 mm away"
    );
    assert_eq!(error.hint(), "set seed_voxel = [3, 0, 0] if that is the organ, or widen the band");
}

#[test]
fn components_and_their_ledger() {
    // Corners connect; the lone voxels at the ends do not.
    let text = "7....7 .7...7 7....7";
    let one = Params { components: Components::Largest, thick_slices: 0.0, ..Params::default() };
    let largest = check(text, &one, "#..... .#.... #.....");
    assert_eq!(largest.report.get("components"), Some(2.0));
    assert_eq!(largest.report.get("components_dropped_voxels"), Some(3.0));
    assert_eq!(largest.ledger.0.len(), 1);
    let entry = &largest.ledger.0[0];
    assert_eq!((entry.kind, entry.position_mm), (LedgerKind::ComponentDropped, DVec3::new(15.0, 12.0, 10.0)));
    assert_eq!(entry.reason, "component of 3 voxels, 0.0300 ml; the 1 largest stay");
    let both = Params { components: Components::Count(2), thick_slices: 0.0, ..Params::default() };
    assert!(check(text, &both, "#....# .#...# #....#").ledger.0.is_empty());

    // 250 single voxels beside a pair: 200 entries and one for the other 50.
    let dots = "7.".repeat(250) + "77.";
    let many = segment(&volume(&dots), &one).expect("a mask");
    assert_eq!((many.mask.n_foreground(), many.ledger.0.len()), (2, 201));
    assert!(many.ledger.0[200].reason.starts_with("50 further components of 50 voxels, at most 1 each"));
    // The 50 are at x = 400, 402, …, 498.
    assert_eq!(many.ledger.0[200].position_mm.x, 10.0 + 449.0);
}

/// Of a mask two lungs stay and noise goes; of a scan the largest component alone.
#[test]
fn main_components() {
    let text = format!("{}.{}.7.7", "7".repeat(40), "7".repeat(3));
    let two = format!("{}.{}....", "#".repeat(40), "#".repeat(3));
    let lungs = check(&text, &Params::default(), &two);
    let reason = "component of 1 voxels, 0.0100 ml; those of at least 5 % of the largest stay";
    assert_eq!(lungs.ledger.0.iter().map(|entry| entry.reason.as_str()).collect::<Vec<_>>(), [reason; 2]);
    assert_eq!(lungs.report.get("components_dropped"), Some(2.0));
    check(&text, &Params { label: Some(7.0.into()), ..Params::default() }, &two);
    // Two voxels of 45 are worth a word, one of 60 is not.
    let words = |segmented: &Segmented| -> Vec<String> {
        let told = segmented.report.warnings.iter().filter(|warning| warning.code == "W-VOLUME-DROPPED");
        told.map(|warning| warning.message.clone()).collect()
    };
    let expected =
        "2 small components of the mask were dropped, together 0.020 ml, 4.4 % of it, the largest 0.010 ml";
    assert!(words(&lungs)[0].starts_with(expected), "{:?}", words(&lungs));
    let noise = check(&format!("{}.7", "7".repeat(59)), &Params::default(), &format!("{}..", "#".repeat(59)));
    assert_eq!((noise.report.get("components_dropped"), words(&noise).len()), (Some(1.0), 0));
    let band = Params { method: Method::Threshold, lower: Some(5.0), ..Params::default() };
    let alone = check(&text, &band, &format!("{}........", "#".repeat(40)));
    assert_eq!(alone.report.get("components_dropped"), Some(3.0));
    check(&text, &Params { components: Components::Main, ..band }, &two);
    check(&text, &Params { min_component_ml: 0.1, ..Params::default() }, &alone_of(&two));
}

/// The first piece of a row.
fn alone_of(row: &str) -> String {
    let (first, rest) = row.split_once('.').expect("two pieces");
    format!("{first}.{}", rest.replace('#', "."))
}

#[test]
fn cavities() {
    let shell = "....... .77777. .77777. .77777. .......";
    let hollow = "....... .77777. .7...7. .77777. .......";
    let empty = "....... ....... ....... ....... .......";
    let closed = [empty, shell, hollow, shell, empty].join("\n\n");
    let filled =
        segment(&volume(&closed), &Params { thick_slices: 0.0, ..Params::default() }).expect("a mask");
    assert_eq!(filled.report.get("cavities_filled"), Some(1.0));
    assert_eq!(filled.report.get("cavities_filled_voxels"), Some(3.0));
    assert_eq!(filled.mask.n_foreground(), 45);
    let kept =
        segment(&volume(&closed), &Params { fill_cavities: false, thick_slices: 0.0, ..Params::default() })
            .expect("a mask");
    assert_eq!((kept.mask.n_foreground(), kept.report.get("cavities_filled")), (42, None));
    // A hole in the shell: background over a face is a way out, over an edge it is not.
    let open = "....... .77777. .7...7. .77.77. .......";
    let opened = segment(&volume(&[empty, shell, open, shell, empty].join("\n\n")), &Params::default());
    assert_eq!(opened.expect("a mask").report.get("cavities_filled"), Some(0.0));
    let edge = "....... .77777. .7...7. .7777.. .......";
    let by_edge = segment(&volume(&[empty, shell, edge, shell, empty].join("\n\n")), &Params::default());
    assert_eq!(by_edge.expect("a mask").report.get("cavities_filled"), Some(1.0));
    // A flat picture lies on the border of its volume altogether.
    check("777 7.7 777", &Params { close_tunnels: false, ..Params::default() }, "### #.# ###");
    // It is a tunnel, though, and as small as faults are.
    check("777 7.7 777", &Params::default(), "### ### ###");
}

#[test]
fn kinds() {
    assert_eq!(inspect_kind(&volume("0110")), Kind::Mask { background: 0.0, foreground: 1.0 });
    assert_eq!(inspect_kind(&volume("7777")), Kind::Constant { value: 7.0 });
    assert_eq!(inspect_kind(&volume("0215")), Kind::Labels { values: vec![0.0, 1.0, 2.0, 5.0] });
    let grid = Grid::axis_aligned([4, 1, 1], DVec3::ONE, DVec3::ZERO).expect("legal");
    let floats = |values: [f32; 4]| {
        let array = Array3::from_shape_vec((1, 1, 4), values.to_vec()).expect("four");
        inspect_kind(&Volume::new(grid.clone(), Voxels::F32(array), 1.0, 0.0))
    };
    assert_eq!(floats([0.5, 1.0, 2.0, f32::INFINITY]), Kind::Ct { min: 0.5, max: 2.0 });
    assert_eq!(floats([-3.0, 0.0, -3.0, f32::NAN]), Kind::Mask { background: 0.0, foreground: -3.0 });
    assert_eq!(floats([-0.0, 0.0, 1.0, 0.0]), Kind::Mask { background: 0.0, foreground: 1.0 });
    assert!(matches!(floats([f32::NAN; 4]), Kind::Constant { value } if value.is_nan()));
    assert_eq!(floats([-1.0, 0.0, 1.0, 2.0]), Kind::Ct { min: -1.0, max: 2.0 });
}

#[test]
fn parameters_are_checked() {
    let key = |text: &str| {
        let params: Params = toml::from_str(text).unwrap_or_else(|error| panic!("{text}: {error}"));
        params.validate().map_or_else(|error| error.key, |()| "".into())
    };
    let cases = [
        ("", ""),
        ("label = 3", ""),
        ("label = 'trachea, 4'", ""),
        ("label = [1, 'trachea']", ""),
        ("label = ''", "label"),
        ("label = nan", "label"),
        ("method = 'mask'\nlabel = 3", "label"),
        ("lower = 3", "lower"),
        ("method = 'label'", "label"),
        ("method = 'threshold'", "upper"),
        ("method = 'threshold'\nlower = 3\nupper = 2", "upper"),
        ("method = 'threshold'\nlower = nan", "lower"),
        ("method = 'threshold'\nlower = 3\nseed_voxel = [1, 2, 3]", "seed_voxel"),
        ("method = 'region-grow'\nupper = -865", "seed_voxel"),
        ("method = 'region-grow'\nupper = -865\nseed_voxel = [1, 2, 3]", ""),
        ("method = 'region-grow'\nupper = -865\nseed_mm = [1.0, 2.0, 3.0]", ""),
        ("method = 'region-grow'\nupper = -865\nseed_mm = [1, 2, 3]\nseed_voxel = [1, 2, 3]", "seed_mm"),
    ];
    for (text, expected) in cases {
        assert_eq!(key(text), expected, "{text}");
    }
    for (text, expected) in [
        ("components = 'auto'", Components::Auto),
        ("components = 'main'", Components::Main),
        ("components = 'largest'", Components::Largest),
        ("components = 'all'", Components::All),
        ("components = 3", Components::Count(3)),
    ] {
        let params: Params = toml::from_str(text).expect("legal");
        assert_eq!(params.components, expected);
        let again: Params = toml::from_str(&toml::to_string(&params).expect("TOML")).expect("legal");
        assert_eq!(again, params);
    }
    for text in ["components = 'most'", "components = 0", "components = -1", "thresh = 3", "method = 'guess'"]
    {
        let error = toml::from_str::<Params>(text).expect_err(text);
        assert!(error.span().is_some(), "{text}: {error} has no place");
    }
}

/// Volumes that are no chest: an error that says so, or a mask; never a panic.
#[test]
fn presets_on_hostile_volumes() {
    let nan = f32::NAN;
    let line = |n: usize, value: &dyn Fn(usize) -> f32| (0..n).map(value).collect::<Vec<f32>>();
    let cases: [([usize; 3], Vec<f32>); 7] = [
        ([1, 1, 1], vec![-1000.0]),
        ([1, 1, 1], vec![nan]),
        ([4, 4, 4], vec![nan; 64]),
        ([4, 4, 4], vec![-1000.0; 64]),
        // Air and tissue by turns, with holes in the data, one voxel thin along each axis.
        ([40, 40, 1], line(1600, &|i| if i % 7 == 0 { nan } else { -1000.0 + (i % 40) as f32 * 30.0 })),
        ([1, 40, 40], line(1600, &|i| if i % 3 == 0 { -1000.0 } else { i as f32 })),
        ([8, 8, 8], line(512, &|i| if i == 100 { f32::INFINITY } else { -1e30 * (i as f32 + 1.0) })),
    ];
    for (shape, values) in cases {
        let [nx, ny, nz] = shape;
        let grid = Grid::axis_aligned(shape, DVec3::ONE, DVec3::ZERO).expect("legal");
        let array = Array3::from_shape_vec((nz, ny, nx), values).expect("the shape");
        let volume = Volume::new(grid, Voxels::F32(array), 1.0, 0.0);
        for preset in [Preset::Airway, Preset::Vessel] {
            for seed_voxel in [None, Some([0, 0, 0]), Some([9, 9, 9])] {
                let params = Params { preset: Some(preset), seed_voxel, ..Params::default() };
                if let Err(error) = segment(&volume, &params) {
                    let class = error.class().exit_code();
                    assert!([2, 3].contains(&class) && !error.hint().is_empty(), "{shape:?}: {error}");
                }
            }
        }
    }
}

/// A band that nothing ends but the preset's limit is no finding, and neither is a handful of voxels.
#[test]
fn a_region_that_never_leaks_is_told() {
    let lumen = |extent: usize| {
        let shape = [extent + 4; 3];
        let inside = |v: usize| (2..extent + 2).contains(&v);
        let at = |(z, y, x)| if inside(x) && inside(y) && inside(z) { -950_i16 } else { 40 };
        let grid = Grid::axis_aligned(shape, DVec3::ONE, DVec3::ZERO).expect("legal");
        let array = Array3::from_shape_fn((shape[2], shape[1], shape[0]), at);
        Volume::new(grid, Voxels::I16(array), 1.0, 0.0)
    };
    let params = Params {
        preset: Some(Preset::Airway),
        method: Method::RegionGrow,
        seed_voxel: Some([4, 4, 4]),
        ..Params::default()
    };
    for (extent, said) in [(12, "no leak found up to -500"), (6, "216 voxels (0.22 ml) at -500, too few")] {
        let grown = segment(&lumen(extent), &params).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(grown.mask.n_foreground(), extent * extent * extent);
        let warning = grown.report.warnings.iter().find(|warning| warning.code == "W-VOLUME-NO-LEAK");
        let message = &warning.expect("a warning").message;
        assert!(message.contains(said), "{message}");
        assert_eq!(grown.report.get("reached_threshold"), Some(-500.0));
    }
    // A band that the user gives is the user's.
    let given =
        segment(&lumen(12), &Params { upper: Some(-500.0), ..params }).unwrap_or_else(|e| panic!("{e}"));
    assert!(given.report.warnings.is_empty(), "{:?}", given.report.warnings);
}

/// A hollow ball whose wall has a pinhole: closing the tunnel closes a cavity in, which is filled and counted.
#[test]
fn cavities_that_closing_a_tunnel_makes_are_counted() {
    let shape = [17; 3];
    let grid = Grid::axis_aligned(shape, DVec3::ONE, DVec3::ZERO).expect("legal");
    let distance = |[x, y, z]: [usize; 3]| (DVec3::new(x as f64, y as f64, z as f64) - 8.0).length();
    let mut mask = espalier_model::Mask::from_fn(grid, |voxel| (3.5..6.5).contains(&distance(voxel)));
    // Two holes through the wall make one tunnel.
    for x in [1, 2, 3, 4, 12, 13, 14, 15] {
        mask.bits_mut().clear([x, 8, 8]);
    }
    let cleaned = espalier_volume::clean(mask.clone(), &Params::default()).unwrap_or_else(|e| panic!("{e}"));
    let count = |name: &str| cleaned.report.get(name);
    assert_eq!((count("tunnels"), count("tunnels_left")), (Some(1.0), Some(0.0)));
    assert_eq!(count("cavities_filled"), Some(1.0));
    let n_added = cleaned.mask.n_foreground() - mask.n_foreground();
    let n_told = ["cavities_filled_voxels", "tunnel_repairs_filled_voxels"].map(count);
    assert_eq!(n_told.into_iter().flatten().sum::<f64>(), n_added as f64);
}

/// A branch aslant through thick slices: interpolated, unless the grid was said to be another.
#[test]
fn thick_slices_are_interpolated_unless_the_grid_is_given() {
    let text = "1110000 1110000\n\n0111000 0111000\n\n0011100 0011100";
    let size = |params: &Params| {
        let segmented = segment(&volume(text), params).unwrap_or_else(|error| panic!("{error}"));
        (segmented.mask.grid().shape(), segmented.report.get("thick_slices_to_voxels"))
    };
    // Voxels of 1 × 2 × 5 mm.
    let default = Params::default();
    assert_eq!(size(&default), ([7, 2, 15], Some(210.0)));
    let own = ([7, 2, 3], None);
    assert_eq!(size(&Params { thick_slices: 0.0, ..default.clone() }), own);
    assert_eq!(size(&Params { thick_slices: 6.0, ..default.clone() }), own);
    assert_eq!(size(&Params { orientation: Orientation::Stored, ..default.clone() }), own);
    let resample_mm = Some(Spacing::Each([1.0, 2.0, 5.0]));
    assert_eq!(size(&Params { resample_mm, ..default }), own);
    for illegal in [-1.0, 0.5, 1.19, 1e4, f64::NAN] {
        let params = Params { thick_slices: illegal, ..Params::default() };
        assert_eq!(code(text, &params), "E-PARAM 2", "{illegal}");
    }
}
