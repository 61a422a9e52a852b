//! SVG, PNG, refusals and odd trees.
#![allow(clippy::expect_used, clippy::panic, reason = "a test that cannot go on must fail")]

mod common;

use common::{fern, flat, front, node, tube};
use espalier_model::diagnose::{Class, Diagnose};
use espalier_model::{Embedding, Tree};
use espalier_render::{
    ColorBy, Compass, Error, Fit, Params, Rendered, Style, Theme, Unit, planar_png, planar_svg, render,
};
use glam::DVec2;

fn draw(tree: &Tree, params: &Params) -> Rendered {
    render(tree, &flat(tree), &front(tree), params).expect("pictures")
}

fn quick() -> Params {
    Params { width_px: 500, exr: false, ..Params::default() }
}

/// The size of a PNG, which must decode.
fn size(png: &[u8]) -> (u32, u32) {
    let image = image::load_from_memory(png).expect("a PNG");
    (image.width(), image.height())
}

#[test]
fn svg_has_a_path_for_each_branch_and_escapes_what_the_user_wrote() {
    let tree = fern(5, 3, 1.0);
    let title = "A <b> & \"c\" \u{7}of \u{1F333}";
    let svg = draw(&tree, &Params { title: Some(title.to_owned()), ..quick() }).svg;
    let document = roxmltree::Document::parse(&svg).expect("well-formed XML");
    let paths: Vec<_> = document
        .descendants()
        .filter(|n| n.has_tag_name("path") && n.attribute("id").is_some_and(|id| id.starts_with("branch-")))
        .collect();
    let branches = tree.branches();
    assert_eq!(paths.len(), branches.list().len());
    for path in paths {
        let index: usize =
            path.attribute("data-branch").and_then(|text| text.parse().ok()).expect("an index");
        let branch = &branches.list()[index];
        assert_eq!(path.attribute("id"), Some(format!("branch-{index}").as_str()));
        assert_eq!(path.attribute("data-generation"), Some(branch.generation.to_string().as_str()));
        let length: f64 = path.attribute("data-length-mm").and_then(|t| t.parse().ok()).expect("a length");
        assert!((length - branches.length_mm(&tree, index)).abs() < 1e-5);
        let outline = path.attribute("d").expect("an outline");
        assert!(outline.starts_with('M') && outline.ends_with('Z') && !outline.contains("NaN"));
    }
    let uses = document.descendants().filter(|n| n.has_tag_name("use")).count();
    assert_eq!(uses, branches.list().len());
    let shown = document.descendants().find(|n| n.has_tag_name("title")).and_then(|n| n.text());
    assert_eq!(shown, Some("A <b> & \"c\"  of \u{1F333}"));
    for group in ["heading", "legend", "scale-bar", "root-mark"] {
        assert!(document.descendants().any(|n| n.attribute("id") == Some(group)), "{group}");
    }
}

/// The texts of a group of an SVG, in order.
fn texts(svg: &str, group: &str) -> Vec<String> {
    let document = roxmltree::Document::parse(svg).expect("well-formed XML");
    document
        .descendants()
        .filter(|n| n.attribute("id") == Some(group))
        .flat_map(|n| n.descendants().filter(|n| n.has_tag_name("text")).collect::<Vec<_>>())
        .filter_map(|n| n.text().map(str::to_owned))
        .collect()
}

#[test]
fn the_key_says_round_numbers_in_a_readable_unit() {
    let legend = |scale: f64, params: &Params| {
        let tree = Tree::new(&[
            node(0.0, 0.0, 0.0, 4.0 * scale, None),
            node(0.0, 0.0, -50.0 * scale, 4.0 * scale, Some(0)),
            node(0.0, 0.0, -50.1 * scale, 1.0 * scale, Some(1)),
            node(0.0, 0.0, -100.0 * scale, 1.0 * scale, Some(2)),
        ])
        .expect("a tree");
        let svg = draw(&tree, params).svg;
        (texts(&svg, "legend"), texts(&svg, "scale-bar"), texts(&svg, "heading"))
    };
    let (ticks, bar, heading) = legend(1.0, &quick());
    assert_eq!(ticks, ["radius (mm)", "1", "2", "2.5 mean", "5"]);
    assert_eq!(bar, ["10 mm"]);
    assert!(heading[0].starts_with("crossings 0 (certified)"), "{heading:?}");
    assert!(heading.iter().any(|line| line.contains("length 100 mm")), "{heading:?}");
    assert_eq!(legend(1e-3, &quick()).0[0], "radius (µm)");
    assert_eq!(legend(1e-3, &quick()).1, ["10 µm"]);
    assert_eq!(legend(1e-6, &quick()).1, ["10 nm"]);
    assert_eq!(legend(1e3, &quick()).1, ["10 m"]);
    assert_eq!(legend(1.0, &Params { unit: Unit::Um, ..quick() }).1, ["10000 µm"]);
    let (steps, ..) = legend(1.0, &Params { color_by: ColorBy::Generation, ..quick() });
    assert_eq!(steps, ["generation", "0"]);
}

#[test]
fn the_name_of_the_root_lies_over_no_branch_and_is_led_to_if_it_is_apart() {
    let arm = |i: u32, n: u32| {
        let (sin, cos) = espalier_geom::math::sin_cos(f64::from(i) * std::f64::consts::TAU / f64::from(n));
        node(30.0 * cos, 0.0, 30.0 * sin, 2.0, Some(0))
    };
    for n_arms in [1, 2, 5, 11] {
        let root = std::iter::once(node(0.0, 0.0, 0.0, 2.0, None));
        let tree = Tree::new(&root.chain((0..n_arms).map(|i| arm(i, n_arms))).collect::<Vec<_>>());
        let tree = tree.expect("a tree");
        let svg = draw(&tree, &quick()).svg;
        let document = roxmltree::Document::parse(&svg).expect("well-formed XML");
        let group = document.descendants().find(|n| n.attribute("id") == Some("root-mark")).expect("a mark");
        let of = |node: roxmltree::Node<'_, '_>, name: &str| -> f64 {
            node.attribute(name).and_then(|text| text.parse().ok()).expect("a number")
        };
        let find = |tag: &str| group.descendants().find(|n| n.has_tag_name(tag));
        let (ring, name) = (find("circle").expect("a ring"), find("text").expect("a name"));
        let at = |x: f64, y: f64| DVec2::new(x, y);
        let center = at(of(ring, "cx"), of(ring, "cy"));
        let mm_per_px = of(document.root_element(), "data-mm-per-px");
        // The name is four letters wide, and stands on its middle.
        let size = of(name, "font-size");
        let corners = [-1.0, 0.0, 1.0].map(|side: f64| {
            [0.0, 0.7].map(|up: f64| at(of(name, "x") + side * size, of(name, "y") - up * size))
        });
        for corner in corners.as_flattened() {
            for i in 0..n_arms {
                let end = center + at(1.0, -1.0) * flat(&tree).positions_mm[i as usize + 1] / mm_per_px;
                let share =
                    ((*corner - center).dot(end - center) / (end - center).length_squared()).clamp(0.0, 1.0);
                let outside_px = corner.distance(center.lerp(end, share)) - 2.0 / mm_per_px;
                assert!(outside_px > 0.0, "{n_arms} arms: {outside_px} px off");
            }
        }
        if [1, 11].contains(&n_arms) {
            assert_eq!(find("line").is_some(), n_arms == 11, "{n_arms} arms");
        }
    }
}

#[test]
fn the_map_alone_is_that_of_all_files() {
    let tree = fern(5, 3, 1.0);
    let all = draw(&tree, &quick());
    assert_eq!(planar_png(&tree, &flat(&tree), &quick()).expect("a picture"), all.png);
    assert_eq!(planar_svg(&tree, &flat(&tree), &quick()).expect("a document"), all.svg);
    assert!(planar_png(&tree, &flat(&tree), &Params { width_px: 1, ..quick() }).is_err());
}

#[test]
fn crossings_are_not_hidden() {
    let tree = fern(5, 2, 1.0);
    let mut embedding = flat(&tree);
    embedding.certificate.crossings = 3;
    let svg = render(&tree, &embedding, &front(&tree), &quick()).expect("pictures").svg;
    assert!(texts(&svg, "heading")[0].starts_with("crossings 3 (not certified)"));
}

#[test]
fn the_pictures_do_not_depend_on_the_number_of_threads() {
    let tree = fern(7, 4, 1.0);
    let params = Params { width_px: 400, ..Params::default() };
    let with = |n_threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build().expect("a pool");
        pool.install(|| draw(&tree, &params))
    };
    assert_eq!(with(1), with(3));
}

#[test]
fn every_style_colour_and_theme_draws() {
    let tree = fern(9, 3, 1.0);
    let plain = draw(&tree, &quick()).png;
    for color_by in [
        ColorBy::BranchRadius,
        ColorBy::Generation,
        ColorBy::Branch,
        ColorBy::AngleLoss,
        ColorBy::LengthLoss,
        ColorBy::OrientationLoss,
        ColorBy::Part,
        ColorBy::Label,
    ] {
        assert_ne!(draw(&tree, &Params { color_by, ..quick() }).png, plain, "{color_by:?}");
    }
    for params in [
        Params { style: Style::Line, ..quick() },
        Params { style: Style::Ribbon, ..quick() },
        Params { theme: Theme::Dark, ..quick() },
        Params { theme: Theme::Print, ..quick() },
        Params { fit: Fit::Turned, ..quick() },
        Params { aspect: Some(0.5), ..quick() },
        Params { width_scale: 2.0, ..quick() },
    ] {
        assert_ne!(draw(&tree, &params).png, plain);
    }
    let lettered = draw(&tree, &quick()).global_view_png;
    assert_ne!(draw(&tree, &Params { compass: Compass::None, ..quick() }).global_view_png, lettered);
    assert!(draw(&tree, &quick()).exr.is_none());
}

#[test]
fn odd_trees_have_pictures() {
    let single = |radius| Tree::new(&[node(3.0, 4.0, 5.0, radius, None)]).expect("a tree");
    let star: Vec<_> = std::iter::once(node(0.0, 0.0, 0.0, 2.0, None))
        .chain(
            (0..300).map(|i: i32| node(f64::from(i % 20) - 9.5, 1.0, f64::from(i / 20) + 1.0, 0.1, Some(0))),
        )
        .collect();
    let chain: Vec<_> = (0..20_000_usize)
        .map(|i| node(i as f64 * 0.01, 0.0, (i % 7) as f64 * 0.001, 5.0, i.checked_sub(1)))
        .collect();
    let cases = [
        ("single", single(2.0)),
        ("single without radius", single(0.0)),
        ("two nodes", tube(1.0, [0.3, 0.2])),
        ("no radii", tube(1.0, [0.0, 0.0])),
        ("one radius", tube(1.0, [0.0, 1.0])),
        ("fat", tube(1.0, [30.0, 20.0])),
        ("nanometres", tube(1e-6, [1e-8, 1e-8])),
        ("kilometres", tube(1e6, [1e3, 1e2])),
        ("star", Tree::new(&star).expect("a tree")),
        ("a long fine fat chain", Tree::new(&chain).expect("a tree")),
    ];
    for (name, tree) in cases {
        for params in [quick(), Params { width_px: 240, style: Style::Line, ..quick() }] {
            let rendered = draw(&tree, &params);
            let (width, height) = size(&rendered.png);
            assert_eq!(width, params.width_px, "{name}");
            assert!(height > 60 && height < 2 * width, "{name}: {height}");
            assert_eq!(size(&rendered.global_view_png).0, params.width_px, "{name}");
            roxmltree::Document::parse(&rendered.svg).unwrap_or_else(|error| panic!("{name}: {error}"));
            assert!(!rendered.svg.contains("NaN") && !rendered.svg.contains("inf"), "{name}");
            assert!(rendered.report.get("covered_percent").is_some_and(|share| share > 0.0), "{name}");
        }
    }
}

#[test]
fn radii_in_a_wrong_unit_give_lines_and_a_warning() {
    let thick = |factor: f64| {
        let tree = fern(5, 8, 1.0);
        let nodes: Vec<_> = tree
            .nodes()
            .iter()
            .map(|node| espalier_model::Node { radius_mm: factor * 0.5, ..*node })
            .collect();
        Tree::new(&nodes).expect("a tree")
    };
    for style in [Style::PseudoSurface, Style::Line] {
        for width_px in [240, 500] {
            let params = Params { width_px, style, ..quick() };
            assert!(draw(&thick(1.0), &params).report.warnings.is_empty(), "true radii");
            let rendered = draw(&thick(10_000.0), &params);
            let codes: Vec<_> = rendered.report.warnings.iter().map(|warning| warning.code).collect();
            assert_eq!(codes, ["W-RENDER-THICK"; 2]);
            let heading = texts(&rendered.svg, "heading").join(" ");
            assert!(heading.contains("as lines, since the radii are too large to draw"), "{heading}");
            assert!(rendered.svg.contains("stroke-linecap") && !rendered.svg.contains("id=\"edges\""));
            // The tree fills its page, as without radii.
            let mm_per_px = |rendered: &Rendered| rendered.report.get("mm_per_px");
            assert_eq!(mm_per_px(&rendered), mm_per_px(&draw(&thick(0.0), &params)));
        }
    }
}

#[test]
fn what_cannot_be_drawn_is_refused_with_a_reason() {
    let tree = fern(5, 2, 1.0);
    let refused = |embedding: &Embedding, params: &Params| {
        render(&tree, embedding, &front(&tree), params).expect_err("a refusal")
    };
    let mut short = flat(&tree);
    short.positions_mm.pop();
    let error = refused(&short, &quick());
    assert!(matches!(error, Error::Mismatch { what: "positions", .. }), "{error}");
    assert_eq!((error.code(), error.class()), ("E-RENDER-MISMATCH", Class::Input));

    let mut broken = flat(&tree);
    broken.positions_mm[3] = DVec2::new(f64::NAN, 0.0);
    assert!(matches!(refused(&broken, &quick()), Error::Number { node: 3, .. }));
    broken.positions_mm[3] = DVec2::new(1e300, 0.0);
    assert!(matches!(refused(&broken, &quick()), Error::Number { node: 3, .. }));

    let error = refused(&flat(&tree), &Params { width_px: 16_000, aspect: Some(2.0), ..quick() });
    assert_eq!((error.code(), error.class()), ("E-RENDER-SIZE", Class::Limit));
    assert!(error.to_string().contains("16000 × 32000"), "{error}");

    for (key, params) in [
        ("width_px", Params { width_px: 239, ..quick() }),
        ("width_scale", Params { width_scale: f64::NAN, ..quick() }),
        ("min_width_px", Params { min_width_px: 0.0, ..quick() }),
        ("aspect", Params { aspect: Some(0.1), ..quick() }),
        ("aspect", Params { aspect: Some(f64::NAN), ..quick() }),
        ("title", Params { title: Some("x".repeat(501)), ..quick() }),
    ] {
        let error = refused(&flat(&tree), &params);
        assert!(matches!(&error, Error::Param(error) if error.key == key), "{error}");
    }

    let mut views = front(&tree);
    views.global.up = views.global.towards_camera;
    let error = render(&tree, &flat(&tree), &views, &quick()).expect_err("a refusal");
    assert!(matches!(error, Error::View { .. }), "{error}");
}

#[test]
fn params_read_what_they_write_and_nothing_else() {
    let params = Params { title: Some("t".to_owned()), style: Style::Line, ..Params::paper() };
    let written = serde_json::to_string(&params).expect("JSON");
    assert!(written.contains("\"branch-radius\"") && written.contains("\"line\""), "{written}");
    assert_eq!(serde_json::from_str::<Params>(&written).expect("params"), params);
    assert!(serde_json::from_str::<Params>("{\"widht_px\": 5}").is_err());
    assert_eq!(serde_json::from_str::<Params>("{}").expect("params"), Params::default());
}
