//! Trees and embeddings made by hand.
#![allow(clippy::expect_used, reason = "a test that cannot go on must fail")]
#![allow(dead_code, reason = "each test file uses a part of it")]

use espalier_geom::math;
use espalier_geom::random::{Purpose, Stream};
use espalier_model::{
    Certificate, Embedding, Energy, LocalPlane, Losses, Node, Pose, SubtreeView, TargetKind, Targets,
    Termination, Tree, View, ViewHierarchy, Widths,
};
use glam::{DVec2, DVec3};

/// A node.
pub(crate) fn node(x: f64, y: f64, z: f64, radius_mm: f64, parent: Option<usize>) -> Node {
    Node { position_mm: DVec3::new(x, y, z), radius_mm, parent, kind: 0 }
}

/// The embedding that drops y: the trees here lie in the plane of x and z.
pub(crate) fn flat(tree: &Tree) -> Embedding {
    let positions_mm: Vec<DVec2> =
        tree.nodes().iter().map(|node| DVec2::new(node.position_mm.x, node.position_mm.z)).collect();
    let n_nodes = tree.n_nodes();
    let angle = |node: usize| {
        let parent = tree.parent(node)?;
        let grandparent = tree.parent(parent)?;
        let at = |node: usize| positions_mm[node];
        Some(espalier_geom::angle::ccw(at(grandparent) - at(parent), at(node) - at(parent)))
    };
    let targets = Targets {
        kind: TargetKind::Intrinsic,
        angle_rad: (0..n_nodes).map(|node| angle(node).unwrap_or(f64::NAN)).collect(),
        length_mm: (0..n_nodes).map(|node| tree.edge_length_mm(node)).collect(),
        heading_rad: vec![0.0; n_nodes],
        confidence: vec![1.0; n_nodes],
    };
    Embedding {
        tree: tree.digest(),
        method: "by hand".to_owned(),
        seed: 0,
        positions_mm,
        quantum_mm: 1e-6,
        targets,
        length_ratio: vec![0.0; n_nodes],
        angle_ratio: vec![0.0; n_nodes],
        energy: Energy::default(),
        losses: Losses { angle3d_error_mean_deg: 0.4, angle3d_error_max_deg: 3.2, ..Losses::default() },
        certificate: Certificate::default(),
        widths: Widths::default(),
        pose: Pose::default(),
        termination: Termination::Constructed,
        trace: Vec::new(),
        methods: Vec::new(),
        edits: Vec::new(),
    }
}

/// The view from the front, the patient's right on the left.
pub(crate) fn front(tree: &Tree) -> ViewHierarchy {
    let center_mm = tree.nodes().iter().map(|node| node.position_mm).sum::<DVec3>() / tree.n_nodes() as f64;
    let global =
        View { towards_camera: DVec3::Y, up: DVec3::Z, center_mm, radius_mm: tree.extent_mm(), loss: 0.1 };
    let branches = tree.branches();
    let plane = LocalPlane { view: global, is_mirrored: false };
    ViewHierarchy {
        tree: tree.digest(),
        global,
        subtrees: vec![SubtreeView { level: 0, root: 0, view: global }],
        chains: vec![plane; branches.list().len()],
        forks: (0..tree.n_nodes()).map(|node| (tree.children(node).len() > 1).then_some(plane)).collect(),
    }
}

/// A straight tube of one edge along x, from the origin.
pub(crate) fn tube(length: f64, radii: [f64; 2]) -> Tree {
    Tree::new(&[node(0.0, 0.0, 0.0, radii[0], None), node(length, 0.0, 0.0, radii[1], Some(0))])
        .expect("a tree")
}

/// A random tree that grows downwards in the plane y ≈ 0: chains that wander a little, forks of two.
pub(crate) fn fern(seed: u64, generations: u32, scale: f64) -> Tree {
    let mut stream = Stream::new(seed, Purpose::Test, 0, 0);
    let mut nodes = vec![node(0.0, 0.0, 0.0, 9.0 * scale, None)];
    // (hub, heading, width of its wedge, length of a branch, radius, generation)
    let mut open = vec![(0_usize, -std::f64::consts::FRAC_PI_2, 2.2, 90.0 * scale, 8.5 * scale, 0_u32)];
    while let Some((hub, heading, wedge, length, radius, generation)) = open.pop() {
        let n_edges = 3 + stream.below(8) as usize;
        let step = length * stream.uniform(0.7, 1.2) / n_edges as f64;
        let (mut at, mut heading, mut parent) = (nodes[hub].position_mm, heading, hub);
        for i in 0..n_edges {
            heading += stream.uniform(-0.12, 0.12);
            let (sin, cos) = math::sin_cos(heading);
            at += DVec3::new(step * cos, 0.15 * step * stream.uniform(-1.0, 1.0), step * sin);
            let taper = 1.0 - 0.15 * (i + 1) as f64 / n_edges as f64;
            nodes.push(node(at.x, at.y, at.z, radius * taper, Some(parent)));
            parent = nodes.len() - 1;
        }
        if generation < generations {
            let turn = wedge / 2.0 * stream.uniform(0.5, 0.8);
            for side in [-1.0, 1.0] {
                let thinner = stream.uniform(0.6, 0.8);
                open.push((
                    parent,
                    heading + side * turn,
                    wedge * 0.72,
                    length * 0.68,
                    radius * thinner,
                    generation + 1,
                ));
            }
        }
    }
    Tree::new(&nodes).expect("a tree")
}
