"""List the names that languages reserve. To support a language, add its rows here."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Mapping
from importlib.resources import files
from itertools import count

KEYWORDS: Mapping[str, str] = {
    "C": (
        "auto break case char const continue default do double else enum extern float for goto if "
        "inline int long register restrict return short signed sizeof static struct switch "
        "typedef union unsigned void volatile while main asm bool complex imaginary alignas "
        "alignof atomic generic noreturn static_assert thread_local constexpr nullptr typeof true "
        "false"
    ),
    "C++": (
        "and and_eq bitand bitor catch class compl concept const_cast decltype delete "
        "dynamic_cast explicit export final friend mutable namespace new noexcept not not_eq "
        "operator or or_eq override private protected public reinterpret_cast requires "
        "static_cast template this throw try typeid typename using virtual wchar_t xor xor_eq"
    ),
    "macros of C": (
        "assert errno eof nan infinity huge_val huge_valf null stdin stdout stderr domain "
        "overflow underflow ploss tloss sing m_pi m_e linux unix offsetof setjmp va_start va_arg "
        "va_end"
    ),
    "Python": (
        "False None True and as assert async await break class continue def del elif else except "
        "finally for from global if import in is lambda nonlocal not or pass raise return try "
        "while with yield match case type __debug__"
    ),
    "Python's built-ins": (
        "abs aiter all anext any ascii bin bool breakpoint bytearray bytes callable chr "
        "classmethod compile complex delattr dict dir divmod enumerate eval exec filter float "
        "format frozenset getattr globals hasattr hash help hex id input int isinstance "
        "issubclass iter len list locals map max memoryview min next object oct open ord pow "
        "print property range repr reversed round set setattr slice sorted staticmethod str sum "
        "super tuple vars zip ellipsis notimplemented exit quit copyright credits license self "
        "cls math numpy np"
    ),
    "MATLAB": (
        "break case catch classdef continue else elseif end for function global if otherwise "
        "parfor persistent return spmd switch try while arguments enumeration events methods "
        "properties import ans pi inf nan nargin nargout varargin varargout"
    ),
    "Octave": (
        "do until endif endwhile endfor endfunction endswitch end_try_catch end_unwind_protect "
        "unwind_protect unwind_protect_cleanup endparfor endclassdef endenumeration endevents "
        "endmethods endproperties endspmd endarguments"
    ),
    "Modelica": (
        "algorithm and annotation assert block break class connect connector constant "
        "constrainedby der discrete each else elseif elsewhen encapsulated end enumeration "
        "equation expandable extends external false final flow for function if import impure in "
        "initial inner input loop model not operator or outer output package parameter partial "
        "protected public pure record redeclare replaceable return stream then true type when "
        "while within time Real Integer Boolean String Modelica terminal pre edge change reinit "
        "sample"
    ),
    "JavaScript": (
        "await break case catch class const continue debugger default delete do else enum export "
        "extends false finally for function if implements import in instanceof interface let new "
        "null package private protected public return static super switch this throw true try "
        "typeof var void while with yield async of arguments eval undefined NaN Infinity Math "
        "Number Object Array globalThis"
    ),
    "functions in exported code": (
        "exp log sqrt sin cos tan atan sinh cosh tanh expm1 log1p pow power abs fabs sign sign_of "
        "expf logf sqrtf sinf cosf tanf atanf sinhf coshf tanhf expm1f log1pf powf fabsf isfinite "
        "isnan floor"
    ),
}
"""Words that must not be used as names in code, by language."""

LIBRARY: Mapping[str, str] = {
    "C": (
        "acos acosh asin asinh atan2 atanh cbrt ceil copysign drem erf erfc exp2 exp10 fdim "
        "finite fma fmax fmin fmod frexp gamma gamma_r hypot ilogb isinf j0 j1 jn ldexp lgamma "
        "lgamma_r llrint llround log10 log2 logb lrint lround modf nearbyint nextafter nexttoward "
        "remainder remquo rint round scalb scalbln scalbn significand signgam sincos tgamma trunc "
        "y0 y1 yn abort atexit atof atoi atol bsearch calloc div exit free getenv labs ldiv "
        "malloc qsort rand random realloc srand strtod strtol system clock difftime time gmtime "
        "localtime mktime ctime signal raise kill alarm sleep pause index rindex strlen strcpy "
        "strcat strcmp strchr memcpy memset memcmp printf scanf puts gets putchar getchar fopen "
        "fclose read write open close link unlink access select accept bind connect listen send "
        "recv socket step advance isalpha isdigit toupper tolower environ daemon end etext edata"
    ),
    "headers of C": (
        "alloca assert complex ctype dirent endian errno fcntl features fenv float inttypes "
        "iso646 limits locale malloc math memory poll pthread regex sched search semaphore setjmp "
        "signal stdalign stdarg stdatomic stdbool stddef stdint stdio stdlib stdnoreturn string "
        "aio aliases ar argp argz byteswap cpio dlfcn elf envz err execinfo fmtmsg fstab fts ftw "
        "gconv gshadow iconv ifaddrs langinfo lastlog libgen libintl mcheck menu mntent monetary "
        "mqueue netdb nl_types nss obstack paths resolv sgtty shadow spawn stab stdio_ext syscall "
        "sysexits tar term termcap termio thread_db ttyent ucontext ulimit utmp utmpx wordexp "
        "strings tgmath threads time uchar unistd utime values wait wchar wctype xlocale mujoco "
        "simstruc mex matrix tmwtypes fmi2functions fmi2typesplatform fmi2functiontypes "
        "fmi3functions fmi3platformtypes fmi3functiontypes unit co_simulation model this_model"
    ),
    "Python's modules and exceptions": (
        "abc aifc antigravity argparse array ast asynchat asyncio asyncore atexit audioop base64 "
        "bdb binascii bisect builtins bz2 calendar cgi cgitb chunk cmath cmd code codecs codeop "
        "collections colorsys compileall compression concurrent configparser contextlib "
        "contextvars copy copyreg cprofile crypt csv ctypes curses dataclasses datetime dbm "
        "decimal difflib dis distutils doctest email encodings ensurepip enum errno faulthandler "
        "fcntl filecmp fileinput fnmatch fractions ftplib functools gc genericpath getopt getpass "
        "gettext glob graphlib grp gzip hashlib heapq hmac html http idlelib imaplib imghdr imp "
        "importlib inspect io ipaddress itertools json keyword lib2to3 linecache locale logging "
        "lzma mailbox mailcap marshal mimetypes mmap modulefinder msilib msvcrt multiprocessing "
        "netrc nis nntplib nt ntpath nturl2path numbers opcode operator optparse os ossaudiodev "
        "pathlib pdb pickle pickletools pipes pkgutil platform plistlib poplib posix posixpath "
        "pprint profile pstats pty pwd py_compile pyclbr pydoc pydoc_data pyexpat queue quopri "
        "random re readline reprlib resource rlcompleter runpy sched secrets select selectors "
        "shelve shlex shutil signal site smtpd smtplib sndhdr socket socketserver spwd sqlite3 "
        "sre_compile sre_constants sre_parse ssl stat statistics string stringprep struct "
        "subprocess sunau symtable sys sysconfig syslog tabnanny tarfile telnetlib tempfile "
        "termios test textwrap this threading time timeit tkinter token tokenize tomllib trace "
        "traceback tracemalloc tty turtle turtledemo types typing unicodedata unittest urllib uu "
        "uuid venv warnings wave weakref webbrowser winreg winsound wsgiref xdrlib xml xmlrpc "
        "zipapp zipfile zipimport zlib zoneinfo scipy ArithmeticError AssertionError "
        "AttributeError BaseException BaseExceptionGroup BlockingIOError BrokenPipeError "
        "BufferError BytesWarning ChildProcessError ConnectionAbortedError ConnectionError "
        "ConnectionRefusedError ConnectionResetError DeprecationWarning EOFError EncodingWarning "
        "EnvironmentError Exception ExceptionGroup FileExistsError FileNotFoundError "
        "FloatingPointError FutureWarning GeneratorExit IOError ImportError ImportWarning "
        "IndentationError IndexError InterruptedError IsADirectoryError KeyError "
        "KeyboardInterrupt LookupError MemoryError ModuleNotFoundError NameError "
        "NotADirectoryError NotImplementedError OSError OverflowError PendingDeprecationWarning "
        "PermissionError ProcessLookupError RecursionError ReferenceError ResourceWarning "
        "RuntimeError RuntimeWarning StopAsyncIteration StopIteration SyntaxError SyntaxWarning "
        "SystemError SystemExit TabError TimeoutError TypeError UnboundLocalError "
        "UnicodeDecodeError UnicodeEncodeError UnicodeError UnicodeTranslateError UnicodeWarning "
        "UserWarning ValueError ZeroDivisionError PythonFinalizationError"
    ),
    "MATLAB": (
        "accumarray acos all angle any area arrayfun asin atan2 axes axis bar besselj beta bode "
        "camlight cat ceil cell cell2mat cellfun char class clc clear close colon colorbar "
        "colormap columns complex conj contour conv cov cross cumprod cumsum curl date deal "
        "deconv delete det diag diary diff disp display div dot double doc echo edit eig ellipse "
        "eps erf error errorbar eval evalin exist factor false fclose feval fft fgetl fieldnames "
        "figure filter find fix fft2 flipud fminsearch fopen format fprintf fread fscanf fwrite "
        "fzero gamma gca gcf get global grad gradient grid gtext hist hold horzcat hypot i "
        "idivide ifft imag image imread imshow ind2sub input inputname int int32 interp1 interp2 "
        "inv isempty isfield isnumeric j kron lasterr legend length light line linspace load "
        "log10 log2 logical logspace lookfor lu magic mat2str mean median mesh meshgrid min max "
        "mod more norm not nnz num2cell num2str numel nyquist ode45 ones optimset pack patch path "
        "pause permute pinv plot plot3 polar poly polyfit polyval position primes print prod "
        "profile qr quad quit rand randn rank rat real regexp rem repmat reshape residue roots "
        "round rows run save scatter set shape shift sim simulink single size slice solve sort "
        "spline sprintf sqrtm squeeze stairs std stem step strcat strcmp string strrep struct "
        "sub2ind subplot sum surf svd system table tempdir test text tic title toc trace trapz "
        "true type uint8 union unique var ver vertcat view warning what which who whos why xlabel "
        "xlim ylabel ylim zeros zlabel zoom"
    ),
    "Modelica": (
        "ceil acos asin atan2 log10 integer noevent smooth delay cardinality homotopy semilinear "
        "instream actualstream spatialdistribution promote ndims size scalar vector matrix "
        "identity diagonal zeros ones fill linspace transpose symmetric cross skew min max mod "
        "rem div"
    ),
    "TeX": (
        "texput plain latex tex article report book letter booktabs amsmath amssymb graphicx "
        "input include document null"
    ),
    "Windows": (
        "aux con nul prn com1 com2 com3 com4 com5 com6 com7 com8 com9 lpt1 lpt2 lpt3 lpt4 lpt5 "
        "lpt6 lpt7 lpt8 lpt9"
    ),
}
"""Names that no model may have: names of functions, modules and headers of languages, and file
names that operating systems reserve. The file or the function of such a model would hide them.
"""


def words_of(*languages: str) -> frozenset[str]:
    """Return the `KEYWORDS` of languages in lower case."""
    return frozenset(" ".join(KEYWORDS[language] for language in languages).lower().split())


WORDS = words_of("C", "C++", "macros of C", "Python", "functions in exported code")
"""Words that must not be used as names in code of any language, because most exports are C or
Python.
"""

TAKEN = words_of(*KEYWORDS) | frozenset(" ".join(LIBRARY.values()).lower().split())
"""Words that must not be used as names of functions or files."""


FILES = TAKEN | frozenset(
    (files("mapmore_cli.annexes.exporting") / "sources" / "functions-of-octave.txt")
    .read_text("utf-8")
    .split()
)
"""Words that must not be used as names of files, because in Octave a file hides a function of the
same name.
"""


LONGEST = 50
"""Largest number of characters of a name, so that prefixes and numbers can be added."""


def identifiers(names: Iterable[str], reserved: Collection[str] = ()) -> list[str]:
    """Return an identifier for every name, valid in all languages. All are different, even if
    capitals are ignored, and none is equal to a name in `reserved`.

    A name stays unchanged if possible, otherwise a number is appended. Characters other than ASCII
    letters and digits become `_`. A `u` precedes names that do not begin with a letter: `_Bool` and
    `__LINE__` are reserved in C, and no name of MATLAB begins with `_`. Long names are cut, because
    MATLAB and C distinguish 63 characters.
    """
    wanted = [re.sub(r"[^A-Za-z0-9_]", "_", name)[:LONGEST] for name in names]
    wanted = [name if name[:1].isalpha() else f"u{name}" for name in wanted]
    used = {*WORDS, *(word.lower() for word in reserved)}
    kept = {name.lower() for name in wanted}
    unique: list[str] = []
    for name in wanted:
        free = name
        if name.lower() in used:
            free = next(f"{name}_{n}" for n in count(2) if f"{name}_{n}".lower() not in used | kept)
        used.add(free.lower())
        unique.append(free)
    return unique
