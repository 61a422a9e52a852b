//! The organ in space beside its map: colours where they belong, the same bytes, odd masks and trees.
#![allow(clippy::expect_used, reason = "a test says what it expects")]

mod common;

use espalier_model::{Bits, Grid, Mask, Node, Tree, View};
use espalier_render::{Compass, Organ, Params, SpaceSubject, SpaceView, branch_colors, space};
use glam::DVec3;

fn params() -> Params {
    Params { width_px: 700, compass: Compass::Anatomical, ..Params::default() }
}

fn view() -> View {
    let center_mm = DVec3::new(30.0, 30.0, 30.0);
    View { towards_camera: DVec3::Y, up: DVec3::Z, center_mm, radius_mm: 30.0, loss: 0.0 }
}

/// A stem from below that forks into two arms, each as thick as `radius_mm`.
fn fork(radius_mm: f64) -> Tree {
    let node =
        |x: f64, z: f64, parent| Node { position_mm: DVec3::new(x, 30.0, z), radius_mm, parent, kind: 0 };
    let nodes = [
        node(30.0, 8.0, None),
        node(30.0, 30.0, Some(0)),
        node(12.0, 50.0, Some(1)),
        node(48.0, 50.0, Some(1)),
    ];
    Tree::new(&nodes).expect("a tree")
}

/// The voxels within the tubes and the nearest branch of each.
fn organ(tree: &Tree) -> (Mask, Vec<u32>) {
    let grid = Grid::axis_aligned([60, 60, 60], DVec3::ONE, DVec3::ZERO).expect("a grid");
    let branches = tree.branches();
    let nearest = |voxel: [usize; 3]| {
        let point = DVec3::from_array(voxel.map(|c| c as f64));
        let distance = |(node, parent): (usize, usize)| {
            let (a, b) = (tree.position_mm(parent), tree.position_mm(node));
            let share = ((point - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0);
            (point.distance(a.lerp(b, share)), node)
        };
        tree.edges().map(distance).reduce(|a, b| if b.0 < a.0 { b } else { a }).expect("an edge")
    };
    let mask = Mask::from_fn(grid, |voxel| nearest(voxel).0 <= tree.nodes()[0].radius_mm);
    let owner = |voxel| branches.of_node(nearest(voxel).1).expect("a branch") as u32 + 1;
    let owners = mask.voxels().map(owner).collect();
    (mask, owners)
}

/// By branch: how many pixels have its hue in the columns of the picture from one share of the width to another.
fn n_pixels(png: &[u8], tree: &Tree, [from, to]: [f64; 2]) -> Vec<usize> {
    let picture = image::load_from_memory(png).expect("a picture").to_rgb8();
    let colors = branch_colors(tree);
    let mut counts = vec![0; colors.len()];
    let width = f64::from(picture.width());
    for (x, _, pixel) in picture.enumerate_pixels() {
        let place = f64::from(x) / width;
        let [r, g, b] = pixel.0.map(f64::from);
        let is_colorful = r.max(g).max(b) - r.min(g).min(b) > 60.0;
        if !(from..to).contains(&place) || !is_colorful {
            continue;
        }
        // Light changes lengths of colours more than their directions.
        let own = DVec3::new(r, g, b).normalize();
        let likeness = |color: &[u8; 3]| own.dot(DVec3::from_array(color.map(f64::from)).normalize());
        let best = (0..colors.len()).max_by(|&a, &b| likeness(&colors[a]).total_cmp(&likeness(&colors[b])));
        counts[best.expect("a branch")] += 1;
    }
    counts
}

#[test]
fn each_branch_has_its_colour_in_every_panel() {
    let tree = fork(4.0);
    let embedding = common::flat(&tree);
    let (mask, branches) = organ(&tree);
    let organ = Some(Organ { grid: mask.grid(), bits: mask.bits(), branches: &branches });
    let subject = SpaceSubject { tree: &tree, embedding: &embedding, view: &view(), organ, turn_deg: 0 };
    let figure = space(&subject, &params()).expect("a figure");
    // Three panels of one width: the tree lies in the plane that the view sees.
    for panel in [[0.0, 0.33], [0.33, 0.66], [0.66, 1.0]] {
        let counts = n_pixels(&figure.png, &tree, panel);
        assert!(counts.iter().all(|&n| n > 40), "{panel:?} {counts:?}");
    }
    let surface = n_pixels(&figure.png, &tree, [0.0, 0.33]);
    let map = n_pixels(&figure.png, &tree, [0.66, 1.0]);
    for (a, b) in surface.iter().zip(&map) {
        let ratio = *a as f64 / *b as f64;
        assert!((0.8..1.25).contains(&ratio), "the tubes are as wide as the mask: {surface:?} {map:?}");
    }
    let document = roxmltree::Document::parse(&figure.svg).expect("XML");
    let has = |id: &str| document.descendants().any(|node| node.attribute("id") == Some(id));
    assert!(["surface", "line-branch-0", "map-branch-2", "numbers", "scale-bar"].into_iter().all(has));

    let threads = |n| rayon::ThreadPoolBuilder::new().num_threads(n).build().expect("threads");
    let again = threads(3).install(|| space(&subject, &params())).expect("a figure");
    assert_eq!(again, threads(1).install(|| space(&subject, &params())).expect("a figure"));
}

#[test]
fn planes_of_the_body_are_seen_as_slices_are_hung() {
    // The stem lies to the right, the arms go up and forwards; seen from the front the stem is on the left.
    let tree = fork(3.0);
    let embedding = common::flat(&tree);
    let letters = |space_view| {
        let subject =
            SpaceSubject { tree: &tree, embedding: &embedding, view: &view(), organ: None, turn_deg: 0 };
        let figure = space(&subject, &Params { space_view, ..params() }).expect("a figure");
        let document = roxmltree::Document::parse(&figure.svg).expect("XML");
        let texts = document
            .descendants()
            .filter(|node| node.has_tag_name("text") && node.attribute("font-weight").is_some());
        let texts = texts.filter(|node| node.text().is_some_and(|text| text.len() == 1));
        texts.take(4).map(|node| node.text().unwrap_or_default().to_owned()).collect::<String>()
    };
    assert_eq!(letters(SpaceView::Coronal), "LRSI");
    assert_eq!(letters(SpaceView::Sagittal), "PASI");
    assert_eq!(letters(SpaceView::Axial), "LRAP");
}

#[test]
fn odd_organs_and_trees_have_a_figure() {
    let grid = Grid::axis_aligned([5, 5, 5], DVec3::new(0.1, 40.0, 3.0), DVec3::splat(-1e4)).expect("a grid");
    let mut one = Bits::new([5, 5, 5]);
    one.set([4, 4, 4]);
    let mut all = Bits::new([5, 5, 5]);
    (0..25).for_each(|row| all.fill_run(row, 0..5));
    let point = Tree::new(&[Node { position_mm: DVec3::ZERO, radius_mm: 0.0, parent: None, kind: 0 }])
        .expect("a tree");
    for tree in [fork(0.0), fork(1e5), point] {
        let embedding = common::flat(&tree);
        // Too few entries, and branches that there are not.
        for (bits, branches) in [(&Bits::new([5, 5, 5]), &[][..]), (&one, &[9_999]), (&all, &[0, 1, 2])] {
            let organ = Some(Organ { grid: &grid, bits, branches });
            let subject =
                SpaceSubject { tree: &tree, embedding: &embedding, view: &view(), organ, turn_deg: 90 };
            let figure = space(&subject, &Params { width_px: 240, ..params() }).expect("a figure");
            assert!(figure.png.len() > 100 && figure.svg.ends_with("</svg>\n"));
        }
    }
}
