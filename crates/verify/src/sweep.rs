//! Which edges of a layout meet where they should not: a plane sweep with exact predicates.
//!
//! **Input** a tree and a position per node. **Output** `Meetings`: the pairs of edges that have a point in common
//! which is no common node of theirs.
//! **Notation** points are ordered by x, then y. An event is a point at which nodes lie. The order holds the edges
//! that the sweep line meets, from below; the line leans by as little as it takes for two events to be met one
//! after the other, so that a vertical edge too has a place in the order.
//! **Steps** for each event p in turn: 1. Neighbours that cross before p change places, and so do those who become
//! neighbours by that: what is left over of the crossings between two events is counted here. 2. The edges through
//! p stand together; find them by bisection. 3. Count the pairs that meet at p for the first time: edges of one
//! node may, unless both leave it the same way. 4. Put the edges that go on from p back, by direction. 5. Pairs of
//! new neighbours that will cross are noted at the first event after their crossing, found by bisection.
//! **Guarantees** exact for coordinates from 1e-80 to 1e65 in size: touching and collinear overlap count, each pair
//! once, and an edge without length counts against whatever it touches, its neighbours too. Every decision is the
//! sign of an orientation, or for 1 and 5 of a comparison of heights.
//! **Source** Shamos and Hoey 1976, Bentley and Ottmann 1979; that the crossings between events need no order of
//! their own: Boissonnat and Preparata, Robust Plane Sweep for Intersecting Segments (2000).
//! **Differs from the source** contacts of every kind; nodes of a tree, at which edges may meet.
//! **Cost** O((N + k) log N) for k meetings; where m collinear edges lie on each other, m² more at each event on
//! them. Stops at ten million meetings.

use std::cmp::{Ordering, Reverse};
use std::collections::BinaryHeap;

use espalier_geom::plane::{Segment, Side, side};
use espalier_model::Tree;
use glam::DVec2;

use crate::exact::compare_heights;
use crate::order::{NONE, Order};

/// After this many meetings the sweep stops: the layout is no layout.
const MOST: usize = 10_000_000;

/// The pairs of edges that meet where they should not.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Meetings {
    /// How many pairs there are.
    pub count: usize,
    /// Pairs of edges, each by its lower node, the lower number first, in the order of the sweep: at most
    /// [`Meetings::LISTED`].
    pub pairs: Vec<(usize, usize)>,
    /// Whether the sweep went to the end; if not, there are more.
    pub is_complete: bool,
}

impl Meetings {
    /// How many pairs are listed.
    pub const LISTED: usize = 10_000;

    fn add(&mut self, a: u32, b: u32) {
        self.count += 1;
        if self.pairs.len() < Self::LISTED {
            self.pairs.push((a.min(b) as usize, a.max(b) as usize));
        }
    }
}

/// Finds the pairs of edges of a layout that meet where they should not.
///
/// # Panics
/// If there is not one position per node, all finite.
///
/// ```
/// use espalier_model::{Node, Tree};
/// use espalier_verify::meetings;
/// use glam::{DVec2, DVec3};
///
/// let node = |z: f64, parent| Node { position_mm: DVec3::new(0.0, 0.0, z), radius_mm: 1.0, parent, kind: 0 };
/// let tree = Tree::new(&[node(0.0, None), node(1.0, Some(0)), node(2.0, Some(1)), node(3.0, Some(2))])?;
/// let mut flat = [(0.0, 0.0), (2.0, 0.0), (2.0, 1.0), (1.0, 1.0)].map(|(x, y)| DVec2::new(x, y));
/// assert_eq!(meetings(&tree, &flat).count, 0);
///
/// flat[3] = DVec2::new(1.0, 0.0); // the tip touches the first edge
/// assert_eq!(meetings(&tree, &flat).pairs, [(1, 3)]);
/// # Ok::<(), espalier_model::TreeError>(())
/// ```
#[must_use]
pub fn meetings(tree: &Tree, positions_mm: &[DVec2]) -> Meetings {
    assert_eq!(positions_mm.len(), tree.n_nodes(), "one position per node");
    assert!(positions_mm.iter().all(|p| p.is_finite()), "finite positions");
    let events = Events::new(positions_mm);
    let mut sweep = Sweep::new(tree, &events);
    for event in 0..events.points.len() as u32 {
        sweep.cross_before(event);
        sweep.pass(event);
        if sweep.found.count >= MOST {
            return sweep.found;
        }
    }
    sweep.found.is_complete = true;
    sweep.found
}

/// The distinct points at which nodes lie, in order.
struct Events {
    points: Vec<DVec2>,
    /// The event of each node.
    of_node: Vec<u32>,
    /// The nodes by event, those of event e from `start[e]` to `start[e + 1]`.
    nodes: Vec<u32>,
    start: Vec<u32>,
}

impl Events {
    fn new(positions: &[DVec2]) -> Self {
        // −0 + 0 is 0, which is the same coordinate in the same place of the order.
        let positions: Vec<DVec2> = positions.iter().map(|&p| p + 0.0).collect();
        let mut nodes: Vec<u32> = (0..positions.len() as u32).collect();
        nodes.sort_by(|&a, &b| {
            let (p, q) = (positions[a as usize], positions[b as usize]);
            p.x.total_cmp(&q.x).then(p.y.total_cmp(&q.y)).then(a.cmp(&b))
        });
        let mut events = Self {
            points: Vec::new(),
            of_node: vec![0; positions.len()],
            nodes: Vec::new(),
            start: Vec::new(),
        };
        for (place, &node) in nodes.iter().enumerate() {
            if events.points.last() != Some(&positions[node as usize]) {
                events.points.push(positions[node as usize]);
                events.start.push(place as u32);
            }
            events.of_node[node as usize] = events.points.len() as u32 - 1;
        }
        events.start.push(nodes.len() as u32);
        events.nodes = nodes;
        events
    }

    fn nodes(&self, event: u32) -> &[u32] {
        &self.nodes[self.start[event as usize] as usize..self.start[event as usize + 1] as usize]
    }
}

/// An edge as the sweep meets it.
#[derive(Clone, Copy)]
struct Edge {
    /// From the end that comes first.
    segment: Segment,
    /// The events of its ends.
    first: u32,
    last: u32,
    /// The node at its last end.
    last_node: u32,
}

impl Edge {
    fn is_vertical(&self) -> bool {
        self.segment.a.x == self.segment.b.x
    }

    fn side_of(&self, p: DVec2) -> Side {
        side(self.segment.a, self.segment.b, p)
    }
}

/// An edge at an event: two of one group may meet there.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Strand {
    /// The tree node at which the edge begins or ends here; a number of its own if it goes through.
    group: u32,
    /// Edges that were in the order and lie on one line have one number, and have met before.
    line: u32,
    edge: u32,
}

struct Sweep<'a> {
    tree: &'a Tree,
    events: &'a Events,
    edges: Vec<Edge>,
    order: Order,
    /// Neighbours that will cross, lower one first, by the first event after that.
    coming: BinaryHeap<Reverse<(u32, u32, u32)>>,
    found: Meetings,
}

impl<'a> Sweep<'a> {
    fn new(tree: &'a Tree, events: &'a Events) -> Self {
        let edge = |node: usize| {
            let parent = tree.parent(node).unwrap_or(0);
            let (of_node, of_parent) = (events.of_node[node], events.of_node[parent]);
            let (first, last) = (of_node.min(of_parent), of_node.max(of_parent));
            let segment = Segment { a: events.points[first as usize], b: events.points[last as usize] };
            Edge { segment, first, last, last_node: if last == of_node { node } else { parent } as u32 }
        };
        Self {
            tree,
            events,
            edges: (0..tree.n_nodes()).map(edge).collect(),
            order: Order::new(tree.n_nodes()),
            coming: BinaryHeap::new(),
            found: Meetings::default(),
        }
    }

    fn edge(&self, edge: u32) -> &Edge {
        &self.edges[edge as usize]
    }

    /// Step 1: brings the order to what it is just before an event.
    fn cross_before(&mut self, event: u32) {
        while let Some(&Reverse((due, lower, upper))) = self.coming.peek()
            && due <= event
            && self.found.count < MOST
        {
            self.coming.pop();
            let are_neighbours =
                self.order.contains(lower) && self.order.contains(upper) && self.order.above(lower) == upper;
            if are_neighbours {
                self.order.swap(lower, upper);
                self.found.add(lower, upper);
                self.watch(self.order.below(upper), upper, event);
                self.watch(lower, self.order.above(lower), event);
            }
        }
    }

    /// Steps 2 to 4.
    fn pass(&mut self, event: u32) {
        let p = self.events.points[event as usize];
        let (below, mut above) = self.order.part(|edge| self.edge(edge).side_of(p) == Side::Left);
        let mut through = Vec::new();
        while above != NONE && self.edge(above).side_of(p) == Side::On {
            through.push(above);
            above = self.order.above(above);
        }
        let mut strands = self.strands_through(&through, event);
        let mut onwards: Vec<u32> =
            through.iter().copied().filter(|&edge| self.edge(edge).last != event).collect();
        self.add_strands_of_nodes(event, &mut strands, &mut onwards);
        self.count_at(&mut strands);

        through.iter().for_each(|&edge| self.order.remove(edge));
        self.sort_by_direction(p, &mut onwards);
        self.count_leaving_alike(p, event, &onwards);
        let mut lower = below;
        for &edge in &onwards {
            self.order.insert(edge, lower, above);
            lower = edge;
        }
        match (onwards.first(), onwards.last()) {
            (Some(&lowest), Some(&highest)) => {
                self.watch(below, lowest, event + 1);
                self.watch(highest, above, event + 1);
            }
            _ => self.watch(below, above, event + 1),
        }
    }

    /// The edges of the order that contain the event's point, from below.
    fn strands_through(&self, through: &[u32], event: u32) -> Vec<Strand> {
        let mut line = 0;
        let strand = |(place, &edge): (usize, &u32)| {
            if place > 0 {
                let (before, this) = (self.edge(through[place - 1]), self.edge(edge));
                // Both contain the point, so their first ends tell whether they are on one line.
                line += u32::from(before.side_of(this.segment.a) != Side::On);
            }
            let Edge { last, last_node, .. } = *self.edge(edge);
            let group = if last == event { last_node } else { self.own_group(edge) };
            Strand { group, line, edge }
        };
        through.iter().enumerate().map(strand).collect()
    }

    /// A group that is no node's.
    fn own_group(&self, edge: u32) -> u32 {
        self.edges.len() as u32 + edge
    }

    /// Adds the edges that begin at the event, and those without length.
    fn add_strands_of_nodes(&self, event: u32, strands: &mut Vec<Strand>, onwards: &mut Vec<u32>) {
        for &node in self.events.nodes(event) {
            let children = self.tree.children(node as usize).iter().map(|&child| child as u32);
            let own = (node != 0).then_some(node);
            for edge in own.into_iter().chain(children) {
                let Edge { first, last, .. } = *self.edge(edge);
                if first == last && Some(edge) == own {
                    strands.push(Strand { group: self.own_group(edge), line: NONE, edge });
                } else if first == event && last != event {
                    strands.push(Strand { group: node, line: NONE, edge });
                    onwards.push(edge);
                }
            }
        }
    }

    /// Step 3, without those who leave alike.
    fn count_at(&mut self, strands: &mut [Strand]) {
        strands.sort_unstable();
        let mut next_group = 0;
        for (place, a) in strands.iter().enumerate() {
            if place == next_group {
                next_group += strands[place..].iter().take_while(|other| other.group == a.group).count();
            }
            for b in &strands[next_group..] {
                if a.line == NONE || a.line != b.line {
                    self.found.add(a.edge, b.edge);
                }
            }
            if self.found.count >= MOST {
                return;
            }
        }
    }

    /// Counts the edges that begin here, at one node, in one direction: they share more than the node.
    fn count_leaving_alike(&mut self, p: DVec2, event: u32, onwards: &[u32]) {
        let beginning = |edge: u32| (self.edges[edge as usize].first == event).then(|| self.first_node(edge));
        let mut alike = Vec::new();
        for (place, &a) in onwards.iter().enumerate() {
            let goes_like_a = |b: u32| side(p, self.edge(a).segment.b, self.edge(b).segment.b) == Side::On;
            let later = onwards[place + 1..].iter().take_while(|&&b| goes_like_a(b));
            let of_same_node = later.filter(|&&b| beginning(a).is_some() && beginning(a) == beginning(b));
            alike.extend(of_same_node.map(|&b| (a, b)));
            if self.found.count + alike.len() >= MOST {
                break;
            }
        }
        alike.into_iter().for_each(|(a, b)| self.found.add(a, b));
    }

    /// The node at the first end of an edge.
    fn first_node(&self, edge: u32) -> u32 {
        let parent = self.tree.parent(edge as usize).unwrap_or(0) as u32;
        if self.edge(edge).last_node == edge { parent } else { edge }
    }

    /// Step 4: from straight down, counter-clockwise, as they stand just after the event from below.
    fn sort_by_direction(&self, p: DVec2, edges: &mut [u32]) {
        edges.sort_unstable_by(|&a, &b| {
            let by_side = match side(p, self.edge(a).segment.b, self.edge(b).segment.b) {
                Side::Left => Ordering::Less,
                Side::On => Ordering::Equal,
                Side::Right => Ordering::Greater,
            };
            by_side.then(a.cmp(&b))
        });
    }

    /// Step 5: notes that two neighbours will cross, if they will, not before the event `from`.
    fn watch(&mut self, lower: u32, upper: u32, from: u32) {
        if lower == NONE || upper == NONE {
            return;
        }
        let (s, t) = (*self.edge(lower), *self.edge(upper));
        let will_cross = t.side_of(s.segment.b) == Side::Left
            && s.side_of(t.segment.b) == Side::Right
            && t.side_of(s.segment.a) == Side::Right
            && s.side_of(t.segment.a) == Side::Left;
        if !will_cross {
            return;
        }
        // The crossing comes before the end of either edge.
        let (mut low, mut high) = (from, s.last.min(t.last));
        while low < high {
            let middle = low.midpoint(high);
            if compare_crossing(&s, &t, self.events.points[middle as usize]) == Ordering::Greater {
                low = middle + 1;
            } else {
                high = middle;
            }
        }
        // A crossing at the event itself is seen there.
        if compare_crossing(&s, &t, self.events.points[low as usize]) == Ordering::Less {
            self.coming.push(Reverse((low, lower, upper)));
        }
    }
}

/// Where the crossing of two edges comes against a point, in the order of points. `lower` is below `upper` until
/// they cross.
fn compare_crossing(lower: &Edge, upper: &Edge, p: DVec2) -> Ordering {
    let (to_lower, to_upper) = (lower.side_of(p), upper.side_of(p));
    for (vertical, to_other) in [(lower, to_upper), (upper, to_lower)] {
        if vertical.is_vertical() {
            let by_height = match to_other {
                Side::Left => Ordering::Less,
                Side::On => Ordering::Equal,
                Side::Right => Ordering::Greater,
            };
            return vertical.segment.a.x.total_cmp(&p.x).then(by_height);
        }
    }
    match (to_lower, to_upper) {
        (Side::On, Side::On) => Ordering::Equal,
        // Between the two, before or after.
        (Side::Left | Side::On, Side::Right | Side::On) => Ordering::Greater,
        (Side::Right | Side::On, Side::Left | Side::On) => Ordering::Less,
        // Above both: the nearer one is the upper one there. With equal heights the crossing is straight below.
        (Side::Left, Side::Left) => match compare_heights(p, &lower.segment, &upper.segment) {
            Ordering::Greater => Ordering::Greater,
            Ordering::Equal | Ordering::Less => Ordering::Less,
        },
        // Below both: as above, and with equal heights the crossing is straight above.
        (Side::Right, Side::Right) => match compare_heights(p, &lower.segment, &upper.segment) {
            Ordering::Less => Ordering::Less,
            Ordering::Equal | Ordering::Greater => Ordering::Greater,
        },
    }
}
