//! Compaction of selected 16-bit lanes to the front of a vector, for machines without an instruction for it.

/// For each selection of eight 16-bit lanes (one bit per lane) the byte indices for `pshufb`: the selected lanes in
/// order, then the last selected lane repeated; for an empty selection, zeros.
pub(crate) static TO_FRONT: [[u8; 16]; 256] = {
    let mut out = [[0x80; 16]; 256];
    let mut choice = 1_u32;
    while choice < 256 {
        let (mut from, mut to) = (0, 0);
        while to < 8 {
            // Advances to the next selected lane; after the last one `from` stays.
            let rest = (choice >> from) & !1;
            if to == 0 {
                from = choice.trailing_zeros();
            } else if rest != 0 {
                from += rest.trailing_zeros();
            }
            out[choice as usize][2 * to] = 2 * from as u8;
            out[choice as usize][2 * to + 1] = 2 * from as u8 + 1;
            to += 1;
        }
        choice += 1;
    }
    out
};

#[cfg(test)]
mod tests {
    use super::TO_FRONT;

    #[test]
    fn chosen_lanes_come_first_and_the_last_one_repeats() {
        for (choice, bytes) in TO_FRONT.iter().enumerate() {
            let chosen: Vec<u8> = (0..8).filter(|lane| choice >> lane & 1 == 1).collect();
            for (k, lane) in bytes.as_chunks::<2>().0.iter().enumerate() {
                let wanted = chosen.get(k).or(chosen.last()).map_or([0x80; 2], |lane| [2 * lane, 2 * lane + 1]);
                assert_eq!(*lane, wanted, "choice {choice:#b}, lane {k}");
            }
        }
    }
}
