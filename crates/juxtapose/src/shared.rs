//! One tree that holds both.
//!
//! **Input** both trees by their limbs, the motion, the chains that match. **Output** the tree, what is known of each of
//! its nodes, the rows of the table.
//! **Steps** 1. All nodes of the baseline, where they are. 2. Along each branch of both, nodes where the follow-up alone
//! has a fork or ends; beyond the baseline's tip the follow-up's nodes, moved so that they go on from there. 3. Branches
//! that only the follow-up has hang from their forks, moved as these are.
//! **Guarantees** lengths and angles of what is new are the follow-up's own; without anything new the tree is the
//! baseline, node for node.
//! **Cost** O(nodes of both · log).

use espalier_model::{Alignment, BranchChange, Branches, Fate, Juxtaposition, Node, SharedNode, Tree};
use glam::DVec3;

use crate::error::Error;
use crate::limbs::Limbs;
use crate::line::Line;
use crate::matching::Chain;
use crate::strand::{Anchors, Strand, between_deg};

/// A place nearer to a node than this share of the branch is that node.
const SNAP: f64 = 1e-3;
/// What interpolation may change of a radius.
const ROUNDING: f64 = 1e-9;

/// Both trees, and what the matching found.
pub(crate) struct Pair<'a> {
    pub(crate) trees: [&'a Tree; 2],
    pub(crate) branches: [&'a Branches; 2],
    pub(crate) limbs: [&'a Limbs; 2],
    pub(crate) alignment: Alignment,
    pub(crate) chains: &'a [Chain],
}

/// Puts both trees into one.
pub(crate) fn share(pair: &Pair<'_>) -> Result<Juxtaposition, Error> {
    let strands: Vec<Strand> = pair.chains.iter().map(|chain| strand(pair, chain)).collect();
    let order = Order::new(pair);
    let mut assembly = Assembly::of_baseline(pair);
    for (chain, strand) in pair.chains.iter().zip(&strands) {
        let first = chain.baseline[0];
        assembly.add_strand(pair, (chain, strand), order.of_baseline[first]);
    }
    for (limb, row) in order.of_baseline.iter().enumerate() {
        if order.chain_of[0][limb].is_none() {
            let nodes = &pair.limbs[0].lines[limb].nodes[1..];
            nodes.iter().for_each(|&node| assembly.info[node].row = Some(*row));
        }
    }
    for (limb, row) in order.of_followup.iter().enumerate() {
        if let Some(row) = row {
            assembly.add_new(pair, limb, *row);
        }
    }
    let rows = rows(pair, &strands, &order);
    let (shared, from) = Tree::with_order(&assembly.nodes)?;
    let nodes = from.into_iter().map(|old| assembly.info[old]).collect();
    let trees = pair.trees.map(Tree::digest);
    Ok(Juxtaposition { trees, alignment: pair.alignment, shared, nodes, rows })
}

/// The lines of a chain in both trees.
fn strand(pair: &Pair<'_>, chain: &Chain) -> Strand {
    let line = |tree: usize, limbs: &[usize]| {
        let list = pair.branches[tree].list();
        Line::along(pair.trees[tree], limbs.iter().map(|&limb| &list[pair.limbs[tree].branch[limb]]))
    };
    let goes_on = |tree: usize, limbs: &[usize]| {
        limbs.last().is_some_and(|&last| !pair.limbs[tree].children[last].is_empty())
    };
    let anchors = Anchors {
        start: chain.parent.is_some() || pair.limbs.iter().any(|limbs| limbs.roots.len() > 1),
        end: goes_on(0, &chain.baseline) && goes_on(1, &chain.followup),
    };
    Strand::new([line(0, &chain.baseline), line(1, &chain.followup)], anchors, pair.alignment.scale)
}

/// Which row is whose.
struct Order {
    /// By tree, by limb: its chain.
    chain_of: [Vec<Option<usize>>; 2],
    /// By limb of the baseline.
    of_baseline: Vec<usize>,
    /// By limb of the follow-up, of what is new.
    of_followup: Vec<Option<usize>>,
    n_rows: usize,
}

impl Order {
    fn new(pair: &Pair<'_>) -> Self {
        let mut chain_of = pair.limbs.map(|limbs| vec![None; limbs.len()]);
        for (chain_idx, chain) in pair.chains.iter().enumerate() {
            chain.baseline.iter().for_each(|&limb| chain_of[0][limb] = Some(chain_idx));
            chain.followup.iter().for_each(|&limb| chain_of[1][limb] = Some(chain_idx));
        }
        let mut n_rows = 0;
        let mut next = || {
            n_rows += 1;
            n_rows - 1
        };
        let mut of_chain = vec![None; pair.chains.len()];
        let row_of = |chain: &Option<usize>| match chain {
            Some(chain) => *of_chain[*chain].get_or_insert_with(&mut next),
            None => next(),
        };
        let of_baseline = chain_of[0].iter().map(row_of).collect();
        let of_followup = chain_of[1].iter().map(|chain| chain.is_none().then(&mut next)).collect();
        Self { chain_of, of_baseline, of_followup, n_rows }
    }
}

/// The shared tree under construction.
struct Assembly {
    nodes: Vec<Node>,
    info: Vec<SharedNode>,
    /// By node of the follow-up: its place in `nodes`.
    of_followup: Vec<Option<usize>>,
}

impl Assembly {
    /// The baseline, as if all of it were lost.
    fn of_baseline(pair: &Pair<'_>) -> Self {
        let [baseline, followup] = pair.trees;
        let info = |(idx, node): (usize, &Node)| SharedNode {
            baseline_node: Some(idx),
            followup_node: None,
            baseline_radius_mm: Some(node.radius_mm),
            followup_radius_mm: None,
            fate: Fate::Lost,
            row: None,
        };
        let mut assembly = Self {
            nodes: baseline.nodes().to_vec(),
            info: baseline.nodes().iter().enumerate().map(info).collect(),
            of_followup: vec![None; followup.n_nodes()],
        };
        assembly.meet(0, 0, Some(followup.nodes()[0].radius_mm));
        assembly
    }

    /// A node of the follow-up lies at a node of the shared tree.
    fn meet(&mut self, shared: usize, followup: usize, radius_mm: Option<f64>) {
        self.of_followup[followup] = Some(shared);
        self.info[shared].followup_node = Some(followup);
        self.info[shared].followup_radius_mm = radius_mm.or(self.info[shared].followup_radius_mm);
        self.widen(shared);
    }

    /// The radius of a shared node is the larger one; the baseline's, where only rounding tells them apart.
    fn widen(&mut self, shared: usize) {
        let SharedNode { baseline_radius_mm, followup_radius_mm, .. } = self.info[shared];
        let (own, other) = (baseline_radius_mm.unwrap_or(0.0), followup_radius_mm.unwrap_or(0.0));
        self.nodes[shared].radius_mm = if other > own * (1.0 + ROUNDING) { other } else { own };
    }

    fn push(&mut self, node: Node, info: SharedNode) -> usize {
        self.nodes.push(node);
        self.info.push(info);
        let shared = self.nodes.len() - 1;
        self.widen(shared);
        if let Some(followup) = info.followup_node {
            self.of_followup[followup] = Some(shared);
        }
        shared
    }

    /// A branch of both.
    fn add_strand(&mut self, pair: &Pair<'_>, (chain, strand): (&Chain, &Strand), row: usize) {
        let line = &strand.baseline;
        let snap_mm = SNAP * line.length_mm();
        let [from, to] = strand.covered();
        if from > snap_mm {
            // The follow-up begins further on.
            self.info[line.nodes[0]].followup_radius_mm = None;
            self.info[line.nodes[0]].followup_node = None;
            self.widen(line.nodes[0]);
        }
        let mut cuts = self.cuts(pair, (chain, strand), snap_mm).into_iter().peekable();
        let mut above = line.nodes[0];
        for outer in 1..line.nodes.len() {
            let node = line.nodes[outer];
            while let Some((arc, followup)) = cuts.next_if(|&(arc, _)| arc < line.arcs_mm[outer]) {
                above = self.insert(pair, strand, (arc, followup), (above, row));
            }
            self.nodes[node].parent = Some(above);
            let arc = line.arcs_mm[outer];
            let is_lost = arc > to + snap_mm;
            self.info[node].row = Some(row);
            self.info[node].fate = if is_lost { Fate::Lost } else { Fate::Matched };
            self.info[node].followup_radius_mm = strand.followup_radius(arc, snap_mm);
            self.widen(node);
            above = node;
        }
        self.extend(pair, strand, row);
    }

    /// Places along the baseline where the follow-up alone has a fork, an end or a beginning, in ascending order; those at
    /// nodes of the baseline are told to these at once.
    fn cuts(
        &mut self,
        pair: &Pair<'_>,
        (chain, strand): (&Chain, &Strand),
        snap_mm: f64,
    ) -> Vec<(f64, usize)> {
        let [line, other] = [&strand.baseline, &strand.followup];
        let limb_end = |&limb: &usize| {
            let nodes = &pair.limbs[1].lines[limb].nodes;
            nodes[nodes.len() - 1]
        };
        let ends: Vec<usize> = chain.followup.iter().map(limb_end).collect();
        let starts = (strand.covered()[0] > snap_mm).then_some(other.nodes[0]);
        let mut cuts = Vec::new();
        for node in starts.into_iter().chain(ends) {
            // Nodes of a chain stand in preorder.
            let place = other.nodes.partition_point(|&known| known < node);
            // What the follow-up has before the root of the baseline is not drawn: a fork there stands at the root.
            let arc = strand.baseline_arc(other.arcs_mm[place]).max(0.0);
            if arc > line.length_mm() + snap_mm {
                continue;
            }
            let near = line.arcs_mm.partition_point(|&known| known < arc);
            let is_near =
                |&at: &usize| line.arcs_mm.get(at).is_some_and(|known| (known - arc).abs() <= snap_mm);
            match [near, near.wrapping_sub(1)].into_iter().find(is_near) {
                Some(at) => self.meet(line.nodes[at], node, None),
                None => cuts.push((arc, node)),
            }
        }
        cuts
    }

    /// A node on an edge of the baseline.
    fn insert(
        &mut self,
        pair: &Pair<'_>,
        strand: &Strand,
        (arc, followup): (f64, usize),
        (above, row): (usize, usize),
    ) -> usize {
        let radius_mm = strand.baseline.radius_mm(arc);
        let kind = pair.trees[1].nodes()[followup].kind;
        let node = Node { position_mm: strand.baseline.point_mm(arc), radius_mm, parent: Some(above), kind };
        let info = SharedNode {
            baseline_node: None,
            followup_node: Some(followup),
            baseline_radius_mm: Some(radius_mm),
            followup_radius_mm: Some(strand.followup.radius_mm(strand.followup_arc(arc))),
            fate: Fate::Matched,
            row: Some(row),
        };
        self.push(node, info)
    }

    /// What the follow-up has beyond the tip of the baseline.
    fn extend(&mut self, pair: &Pair<'_>, strand: &Strand, row: usize) {
        let (line, other) = (&strand.baseline, &strand.followup);
        let length = line.length_mm();
        let tip = strand.followup_arc(length);
        let shift = line.end_mm() - pair.alignment.apply(other.point_mm(tip));
        let mut above = line.nodes[line.nodes.len() - 1];
        for (place, &node) in other.nodes.iter().enumerate() {
            if strand.baseline_arc(other.arcs_mm[place]) > length * (1.0 + SNAP) {
                above = self.follow(pair, node, (above, shift, row));
            }
        }
    }

    /// A branch that only the follow-up has.
    fn add_new(&mut self, pair: &Pair<'_>, limb: usize, row: usize) {
        let nodes = &pair.limbs[1].lines[limb].nodes;
        // Every fork of the follow-up is in a chain, or in a new branch that was added before.
        let mut above = self.of_followup[nodes[0]].unwrap_or(0);
        let hub_mm = pair.trees[1].position_mm(nodes[0]);
        let shift = self.nodes[above].position_mm - pair.alignment.apply(hub_mm);
        for &node in &nodes[1..] {
            above = self.follow(pair, node, (above, shift, row));
        }
    }

    /// A node that only the follow-up has.
    fn follow(
        &mut self,
        pair: &Pair<'_>,
        followup: usize,
        (above, shift, row): (usize, DVec3, usize),
    ) -> usize {
        let own = pair.trees[1].nodes()[followup];
        let position_mm = pair.alignment.apply(own.position_mm) + shift;
        let info = SharedNode {
            baseline_node: None,
            followup_node: Some(followup),
            baseline_radius_mm: None,
            followup_radius_mm: Some(own.radius_mm),
            fate: Fate::New,
            row: Some(row),
        };
        self.push(Node { position_mm, parent: Some(above), ..own }, info)
    }
}

/// The rows of the table.
fn rows(pair: &Pair<'_>, strands: &[Strand], order: &Order) -> Vec<BranchChange> {
    let mut rows: Vec<Option<BranchChange>> = vec![None; order.n_rows];
    for (chain, strand) in pair.chains.iter().zip(strands) {
        let row = order.of_baseline[chain.baseline[0]];
        rows[row] = Some(matched(pair, (chain, strand), chain.parent.map(|parent| &strands[parent])));
    }
    for (limb, &row) in order.of_baseline.iter().enumerate() {
        rows[row].get_or_insert_with(|| alone(pair, 0, limb));
    }
    for (limb, row) in order.of_followup.iter().enumerate() {
        if let Some(row) = row {
            rows[*row].get_or_insert_with(|| alone(pair, 1, limb));
        }
    }
    rows.into_iter().flatten().collect()
}

fn matched(pair: &Pair<'_>, (chain, strand): (&Chain, &Strand), parent: Option<&Strand>) -> BranchChange {
    let numbers =
        |tree: usize, limbs: &[usize]| limbs.iter().map(|&limb| pair.limbs[tree].branch[limb]).collect();
    let angle = |tree: usize, own: &Line, parent: Option<&Line>| {
        parent.map_or(f64::NAN, |parent| turn_deg(pair.trees[tree], parent, own))
    };
    let first = pair.limbs[0].branch[chain.baseline[0]];
    BranchChange {
        baseline_branches: numbers(0, &chain.baseline),
        followup_branches: numbers(1, &chain.followup),
        generation: pair.branches[0].list()[first].generation,
        angle_deg: [
            angle(0, &strand.baseline, parent.map(|parent| &parent.baseline)),
            angle(1, &strand.followup, parent.map(|parent| &parent.followup)),
        ],
        ..strand.change(&pair.alignment)
    }
}

/// A branch that only one tree has.
fn alone(pair: &Pair<'_>, tree: usize, limb: usize) -> BranchChange {
    let (limbs, line) = (pair.limbs[tree], &pair.limbs[tree].lines[limb]);
    let number = limbs.branch[limb];
    let whole = [0.0, line.length_mm()];
    let of_one = |value: f64| if tree == 0 { [value, f64::NAN] } else { [f64::NAN, value] };
    let angle =
        limbs.parent[limb].map_or(f64::NAN, |parent| turn_deg(pair.trees[tree], &limbs.lines[parent], line));
    let branches = |of: usize| if of == tree { vec![number] } else { Vec::new() };
    BranchChange {
        fate: if tree == 0 { Fate::Lost } else { Fate::New },
        baseline_branches: branches(0),
        followup_branches: branches(1),
        generation: pair.branches[tree].list()[number].generation,
        length_mm: of_one(line.length_mm()),
        compared_mm: 0.0,
        radius_mm: of_one(line.mean_radius_mm(whole)),
        narrowest_percent: f64::NAN,
        narrowest_at_mm: f64::NAN,
        angle_deg: of_one(angle),
        heading_change_deg: f64::NAN,
        end_offset_mm: f64::NAN,
    }
}

/// By how much a branch turns off its parent, in degrees.
fn turn_deg(tree: &Tree, parent: &Line, own: &Line) -> f64 {
    let hub_radius_mm = tree.nodes()[own.nodes[0]].radius_mm;
    between_deg(parent.direction_at_end(), own.direction_at_start(hub_radius_mm))
}
