//! The edges that the sweep line meets, from below: a list that can be searched.
//!
//! **Input** edges put in beside each other, taken out, changed with their neighbours. **Output** neighbours in
//! constant time; the first edge for which a condition ends, in logarithmic time.
//! **Notation** a slot is a place in the list; slots are the nodes of a treap, whose priorities are a fixed
//! function of the slot. **Guarantees** no recursion; what is found does not depend on the shape of the treap.
//! **Source** Seidel and Aragon, Randomized Search Trees (1996).

/// No slot, no edge.
pub(crate) const NONE: u32 = u32::MAX;

#[derive(Clone, Copy)]
struct Slot {
    edge: u32,
    parent: u32,
    left: u32,
    right: u32,
    below: u32,
    above: u32,
}

/// Edges in order.
pub(crate) struct Order {
    slots: Vec<Slot>,
    free: Vec<u32>,
    root: u32,
    /// The slot of each edge, `NONE` if it is not in.
    slot_of: Vec<u32>,
}

impl Order {
    /// An empty order for edges below a number.
    pub(crate) fn new(n_edges: usize) -> Self {
        Self { slots: Vec::new(), free: Vec::new(), root: NONE, slot_of: vec![NONE; n_edges] }
    }

    /// The next edge above; `NONE` if there is none.
    pub(crate) fn above(&self, edge: u32) -> u32 {
        self.edge_at(self.slots[self.slot_of[edge as usize] as usize].above)
    }

    /// The next edge below; `NONE` if there is none.
    pub(crate) fn below(&self, edge: u32) -> u32 {
        self.edge_at(self.slots[self.slot_of[edge as usize] as usize].below)
    }

    /// Whether an edge is in.
    pub(crate) fn contains(&self, edge: u32) -> bool {
        self.slot_of[edge as usize] != NONE
    }

    /// The last edge for which `is_below` holds and the first for which it does not; it holds up to some edge and
    /// for none above. `NONE` where there is none.
    pub(crate) fn part(&self, is_below: impl Fn(u32) -> bool) -> (u32, u32) {
        let (mut slot, mut last, mut first) = (self.root, NONE, NONE);
        while slot != NONE {
            let Slot { edge, left, right, .. } = self.slots[slot as usize];
            if is_below(edge) {
                (last, slot) = (edge, right);
            } else {
                (first, slot) = (edge, left);
            }
        }
        (last, first)
    }

    /// Puts an edge between two neighbours, either of which may be `NONE`.
    pub(crate) fn insert(&mut self, edge: u32, below: u32, above: u32) {
        let (below, above) = (self.slot_at(below), self.slot_at(above));
        let slot = Slot { edge, parent: NONE, left: NONE, right: NONE, below, above };
        let place = self.free.pop().unwrap_or_else(|| {
            self.slots.push(slot);
            (self.slots.len() - 1) as u32
        });
        self.slots[place as usize] = slot;
        self.slot_of[edge as usize] = place;
        if below != NONE {
            self.slots[below as usize].above = place;
        }
        if above != NONE {
            self.slots[above as usize].below = place;
        }
        // Between two neighbours in order, one of these two places in the treap is free.
        if below != NONE && self.slots[below as usize].right == NONE {
            self.slots[below as usize].right = place;
            self.slots[place as usize].parent = below;
        } else if above != NONE {
            self.slots[above as usize].left = place;
            self.slots[place as usize].parent = above;
        } else {
            self.root = place;
        }
        while let parent = self.slots[place as usize].parent
            && parent != NONE
            && priority(place) > priority(parent)
        {
            self.rotate_up(place);
        }
    }

    /// Takes an edge out.
    pub(crate) fn remove(&mut self, edge: u32) {
        let place = self.slot_of[edge as usize];
        let Slot { below, above, .. } = self.slots[place as usize];
        if below != NONE {
            self.slots[below as usize].above = above;
        }
        if above != NONE {
            self.slots[above as usize].below = below;
        }
        loop {
            let Slot { left, right, .. } = self.slots[place as usize];
            match (left, right) {
                (NONE, NONE) => break,
                (child, NONE) | (NONE, child) => self.rotate_up(child),
                (a, b) => self.rotate_up(if priority(a) > priority(b) { a } else { b }),
            }
        }
        let parent = self.slots[place as usize].parent;
        self.replace_child(parent, place, NONE);
        self.slot_of[edge as usize] = NONE;
        self.free.push(place);
    }

    /// Changes two edges with each other.
    pub(crate) fn swap(&mut self, a: u32, b: u32) {
        let (slot_a, slot_b) = (self.slot_of[a as usize], self.slot_of[b as usize]);
        self.slots[slot_a as usize].edge = b;
        self.slots[slot_b as usize].edge = a;
        self.slot_of[a as usize] = slot_b;
        self.slot_of[b as usize] = slot_a;
    }

    fn edge_at(&self, slot: u32) -> u32 {
        if slot == NONE { NONE } else { self.slots[slot as usize].edge }
    }

    fn slot_at(&self, edge: u32) -> u32 {
        if edge == NONE { NONE } else { self.slot_of[edge as usize] }
    }

    fn rotate_up(&mut self, place: u32) {
        let parent = self.slots[place as usize].parent;
        let grandparent = self.slots[parent as usize].parent;
        let moved = if self.slots[parent as usize].left == place {
            let moved = std::mem::replace(&mut self.slots[place as usize].right, parent);
            self.slots[parent as usize].left = moved;
            moved
        } else {
            let moved = std::mem::replace(&mut self.slots[place as usize].left, parent);
            self.slots[parent as usize].right = moved;
            moved
        };
        if moved != NONE {
            self.slots[moved as usize].parent = parent;
        }
        self.slots[parent as usize].parent = place;
        self.slots[place as usize].parent = grandparent;
        self.replace_child(grandparent, parent, place);
    }

    /// Puts `new` where `old` hangs from `parent`, the root's parent being `NONE`.
    fn replace_child(&mut self, parent: u32, old: u32, new: u32) {
        if parent == NONE {
            self.root = new;
        } else if self.slots[parent as usize].left == old {
            self.slots[parent as usize].left = new;
        } else {
            self.slots[parent as usize].right = new;
        }
    }
}

/// Scatters slots over the priorities: two rounds of a multiplication by the golden ratio and a shift.
fn priority(slot: u32) -> u32 {
    let once = slot.wrapping_add(1).wrapping_mul(0x9E37_79B1);
    let mixed = (once ^ (once >> 15)).wrapping_mul(0x85EB_CA77);
    mixed ^ (mixed >> 13)
}

#[cfg(test)]
mod tests {
    use espalier_geom::random::{Purpose, Stream};

    use super::*;

    #[test]
    fn equals_a_plain_list() {
        let mut stream = Stream::new(1, Purpose::Test, 4500, 0);
        let (mut order, mut list) = (Order::new(300), Vec::<u32>::new());
        for _ in 0..30_000 {
            let edge = stream.below(300);
            let place = list.iter().position(|&other| other == edge);
            match (stream.below(3), place) {
                (0, Some(place)) => {
                    order.remove(edge);
                    list.remove(place);
                }
                (_, None) => {
                    let place = stream.below(list.len() as u32 + 1) as usize;
                    let below = place.checked_sub(1).map_or(NONE, |below| list[below]);
                    order.insert(edge, below, list.get(place).copied().unwrap_or(NONE));
                    list.insert(place, edge);
                }
                (_, Some(place)) if place + 1 < list.len() => {
                    order.swap(edge, list[place + 1]);
                    list.swap(place, place + 1);
                }
                _ => {}
            }
            let cut = stream.below(list.len() as u32 + 1) as usize;
            let rank = |edge: u32| list.iter().position(|&other| other == edge);
            let expected =
                (cut.checked_sub(1).map_or(NONE, |last| list[last]), list.get(cut).copied().unwrap_or(NONE));
            assert_eq!(order.part(|edge| rank(edge) < Some(cut)), expected);
            if expected.0 != NONE {
                assert_eq!(order.above(expected.0), expected.1);
            }
            if expected.1 != NONE {
                assert_eq!(order.below(expected.1), expected.0);
            }
        }
    }

    #[test]
    fn the_treap_is_shallow() {
        let mut order = Order::new(100_000);
        for edge in 0..100_000 {
            order.insert(edge, edge.checked_sub(1).unwrap_or(NONE), NONE);
        }
        let steps = std::cell::Cell::new(0);
        order.part(|edge| {
            steps.set(steps.get() + 1);
            edge < 77_777
        });
        assert!(steps.get() < 100, "{}", steps.get());
    }
}
