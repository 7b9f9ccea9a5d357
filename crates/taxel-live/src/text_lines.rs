//! Lines of text out of bytes as they arrive; each byte is in a line or counted.

/// Lines of text, and the bytes that arrived after the last one: at most a line and what was pushed last.
#[derive(Debug)]
pub struct TextLines {
    longest: usize,
    bytes: Vec<u8>,
    /// Number of these bytes that hold no end of a line.
    searched: usize,
    /// Whether they continue a line of which the beginning was returned, as it is too long.
    cut: bool,
    /// The bytes that are in no line, since [`TextLines::take_left_out`].
    pub left_out: LeftOut,
}

/// A line of text, without its end.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TextLine {
    /// The text; bytes that are no UTF-8 are replaced.
    pub text: String,
    /// Number of its bytes.
    pub bytes: u64,
    /// Whether this is only the beginning of a line that is too long.
    pub cut: bool,
}

/// Number of bytes that arrived and that are in no line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct LeftOut {
    /// Those that cannot be part of a line.
    pub in_no_line: u64,
    /// Those of lines whose end did not arrive, or whose beginning did not.
    pub unfinished: u64,
}

impl TextLines {
    /// Lines of at most `longest` bytes. A longer line is returned up to there, and its rest is left out.
    #[must_use]
    pub fn new(longest: usize) -> Self {
        Self { longest, bytes: vec![], searched: 0, cut: false, left_out: LeftOut::default() }
    }

    /// Appends bytes that arrived.
    pub fn push(&mut self, bytes: &[u8]) {
        self.bytes.extend_from_slice(bytes);
    }

    /// Makes a line the next one again.
    pub fn put_back(&mut self, line: &TextLine) {
        self.bytes.splice(0..0, format!("{}\n", line.text).into_bytes());
        self.searched = 0;
    }

    /// The next line, which a line feed or a carriage return ends; the last one may lack its end where no more can arrive
    /// (`ended`).
    pub fn next(&mut self, ended: bool) -> Option<TextLine> {
        loop {
            let end = self.bytes[self.searched..].iter().position(|byte| matches!(byte, b'\n' | b'\r'));
            let end = end.map(|place| self.searched + place);
            let length = end.unwrap_or(self.bytes.len());
            if self.cut {
                self.left_out.in_no_line += length as u64;
                self.cut = end.is_none();
                self.remove(end.map_or(length, |end| end + 1));
                if self.cut {
                    return None;
                }
                continue;
            }
            let long = length > self.longest;
            if end.is_none() && !long && !(ended && length > 0) {
                self.searched = length;
                return None;
            }
            let length = length.min(self.longest);
            let text = String::from_utf8_lossy(&self.bytes[..length]).into_owned();
            self.cut = long;
            self.remove(if long { length } else { end.map_or(length, |end| end + 1) });
            return Some(TextLine { text, bytes: length as u64, cut: long });
        }
    }

    fn remove(&mut self, bytes: usize) {
        self.bytes.drain(..bytes);
        self.searched = 0;
    }

    /// Number of bytes of the line that has not ended.
    #[must_use]
    pub fn waiting(&self) -> usize {
        self.bytes.len()
    }

    /// The bytes that were left out since the last call.
    pub fn take_left_out(&mut self) -> LeftOut {
        std::mem::take(&mut self.left_out)
    }

    /// Leaves out what arrived of a line that has not ended: what comes next does not continue it.
    pub fn discard(&mut self) {
        let place = if self.cut { &mut self.left_out.in_no_line } else { &mut self.left_out.unfinished };
        *place += self.bytes.len() as u64;
        self.remove(self.bytes.len());
        self.cut = false;
    }
}

#[cfg(test)]
mod tests {
    use rand::rngs::StdRng;
    use rand::{Rng, SeedableRng};

    use super::*;

    /// The lines of bytes by their definition, each with whether it is only a beginning, and what is left out.
    fn split(bytes: &[u8], longest: usize) -> (Vec<TextLine>, LeftOut) {
        let (mut lines, mut left_out) = (vec![], LeftOut::default());
        let mut parts: Vec<&[u8]> = bytes.split(|byte| matches!(byte, b'\n' | b'\r')).collect();
        let last = parts.pop().unwrap_or_default();
        if last.len() > longest {
            parts.push(last);
        } else {
            left_out.unfinished = last.len() as u64;
        }
        for part in parts {
            let (line, rest) = part.split_at(part.len().min(longest));
            let text = String::from_utf8_lossy(line).into_owned();
            lines.push(TextLine { text, bytes: line.len() as u64, cut: !rest.is_empty() });
            left_out.in_no_line += rest.len() as u64;
        }
        (lines, left_out)
    }

    #[test]
    fn wherever_the_bytes_are_cut_the_lines_are_the_same_and_few_bytes_are_held() {
        for seed in 0..200 {
            let mut random = StdRng::seed_from_u64(seed);
            let longest = [1, 20, 1000, 1 << 16][random.random_range(0..4)];
            let mut bytes: Vec<u8> = vec![];
            for _ in 0..random.random_range(0..20) {
                let near = longest + random.random_range(0..3) - 1;
                let length = [random.random_range(0..20), longest / 10, near, 5 * longest][random.random_range(0..4)];
                match random.random_range(0..4) {
                    0 => bytes.extend((0..length).map(|_| random.random::<u8>())),
                    kind => bytes.extend(std::iter::repeat_n([b'1', 0, 0xff][kind - 1], length)),
                }
                bytes.extend([&b"\n"[..], b"\r\n", b"\r", b""][random.random_range(0..4)]);
            }
            let (mut reader, mut lines, mut rest) = (TextLines::new(longest), vec![], &bytes[..]);
            let most = [1, 7, 4096][random.random_range(0..3)].max(longest / 100);
            while !rest.is_empty() {
                let piece = random.random_range(1..=most).min(rest.len());
                reader.push(&rest[..piece]);
                rest = &rest[piece..];
                lines.extend(std::iter::from_fn(|| reader.next(false)));
                assert!(reader.waiting() <= longest, "seed {seed}: {}", reader.waiting());
            }
            assert!(
                reader.bytes.capacity() <= 4 * longest.max(most).max(2),
                "seed {seed}: {}",
                reader.bytes.capacity()
            );
            reader.discard();
            let (expected, left_out) = split(&bytes, longest);
            assert!(lines == expected, "seed {seed}");
            assert_eq!(reader.take_left_out(), left_out, "seed {seed}");
            assert_eq!(reader.take_left_out(), LeftOut::default());
        }
    }

    #[test]
    fn a_line_that_is_put_back_comes_again_and_the_last_one_may_lack_its_end() {
        let mut lines = TextLines::new(8);
        lines.push(b"1,2\n3,4");
        let first = lines.next(false).unwrap();
        lines.put_back(&first);
        assert_eq!(lines.next(false), Some(first));
        assert_eq!(lines.next(false), None);
        assert_eq!(lines.next(true).unwrap().text, "3,4");
        assert_eq!((lines.next(true), lines.take_left_out()), (None, LeftOut::default()));
    }
}
