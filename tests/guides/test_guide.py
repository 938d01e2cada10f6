"""The reader of guides itself: a page that cannot be followed says why."""
import pytest
from guide import Guide, GuideError, blocks


def page(folder, text):
    (folder / 'docs' / 'guides').mkdir(parents=True)
    (folder / 'docs' / 'guides' / 'a.md').write_text(text)
    (folder / 'there.cpp').write_text('first\n  second\nlast\n')
    return Guide('a', folder / 'tree', folder)


def test_blocks_are_applied_where_they_belong(tmp_path):
    guide = page(tmp_path,
                 'Text.\n\nNew file `new.cpp`:\n\n```cpp\nnew\n```\n\nIn `there.cpp`, below `second`:\n\n```cpp\n'
                           'third\n```\n\nIn `there.cpp`, above '
                           '`second`:\n\n```cpp\nhalf\n```\n\nRun.\n\n```sh\nstipple a\n```\n')
    guide.follow()
    assert (tmp_path / 'tree/new.cpp').read_text() == 'new\n'
    assert (tmp_path / 'tree/there.cpp').read_text() == 'first\nhalf\n  second\nthird\nlast\n'
    assert guide.touched == ['new.cpp', 'there.cpp'] and guide.commands == ['stipple a']
    assert (tmp_path / 'there.cpp').read_text() == 'first\n  second\nlast\n'
    assert guide.count() == 2 and guide.count('new') == 1


@pytest.mark.parametrize('caption, reason', [
    ('Some text:', 'does not say which file'),
    ('New file `there.cpp`:', 'is there already'),
    ('In `there.cpp`, below `third`:', 'has the line .third. 0 times')])
def test_a_page_that_cannot_be_followed_is_an_error(tmp_path, caption, reason):
    guide = page(tmp_path, f'{caption}\n\n```cpp\nx\n```\n')
    with pytest.raises(GuideError, match=reason):
        guide.follow()


def test_captions_are_the_line_above():
    (caption, language, code), = blocks('In `a`, below `b`:\nNew file `c`:\n\n```cpp\nx\n```\n')
    assert (caption['new'], language, code) == ('c', 'cpp', 'x\n')
